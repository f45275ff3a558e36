"""An aerial triangulation without its report, which takes 40 % of the time of a small block."""

from __future__ import annotations

from flows.stories.aerial_triangulation import adjusted_block, publish, remarks_on, trust_map_of
from flows.stories.block_preparation import prepare_block
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.store import Store


def adjustment_alone(project: Project, store: Store) -> Summary:
    """The story for tests that read tables and summary only."""
    block = prepare_block(project, store)
    adjusted = adjusted_block(project, store, block, trust_map=project.trust_map)
    maps = trust_map_of(project, store, adjusted)
    return publish(store, project, (*block.stages, adjusted, remarks_on(adjusted, store), *maps))
