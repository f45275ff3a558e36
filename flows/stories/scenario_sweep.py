"""Scenario sweep: one project adjusted with many sub-blocks, choices of control points and settings."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from flows.runs.project_run import RunRequest, Story
from flows.runs.stage import Attempt, stage
from flows.runs.workers import workers
from flows.stories.block_preparation import PreparedBlock, approximate_block, prepare_block
from tasks.errors import AerocalError
from tasks.results import publish as publishing
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.settings.published_sweep import published_table
from tasks.settings.sweep import SweepSettings
from tasks.stages import bundle_adjustment_stage, sweep_page
from tasks.stages import sub_block as selection
from tasks.stages import sweep_table as tabulate
from tasks.stages.approximate_values_stage import MOUNTINGS
from tasks.store.store import Outputs, Store
from tasks.sweep import publication
from tasks.sweep.scenario import Computed, Scenario, in_one_line, scenarios

adjust_bundle = stage(bundle_adjustment_stage.adjust_bundle)
select_images = stage(selection.select_images)
assign_roles = stage(selection.assign_roles)
tabulate_sweep = stage(tabulate.tabulate_sweep)
write_sweep_page = stage(sweep_page.write_sweep_page)
publish_sweep = stage(publication.publish_sweep)

_log = logging.getLogger("aerocal")
#: What an adjustment begins with.
_APPROXIMATE = ("approximate_points", "approximate_boresight", "approximate_orientations")


def sweep_of(request: RunRequest) -> Story:
    """The sweep of a project file as a story; its variants are read when it is run.

    The story raises InstallationError if the machine is in the way (full disk, no permission, a worker
    was ended, no cluster).
    """
    return lambda project, store: scenario_sweep(project, request.variants(), store)


def scenario_sweep(project: Project, variants: Mapping[str, Project], store: Store) -> Summary:
    """Prepare the block, adjust every scenario, put all figures into one table and on one page.

    Parameters
    ----------
    project : with the settings of the sweep.
    variants : the project with the settings of each variant, by name.
    """
    publishing.require_replaceable(store, publishing.OF_EVERY_SWEEP)
    sweep = project.sweep or SweepSettings()
    blocks = _prepared(variants, store)
    cases = [
        _Case(scenario, sweep, variants[scenario.variant], blocks[scenario.variant])
        for scenario in scenarios(sweep)
    ]
    with workers(sweep.workers, (store.folder.parent,)) as executor:
        computed = _computed(cases, store, executor)
    table = tabulate_sweep(store, computed=computed)
    published = published_table(sweep.compare_with) if sweep.compare_with is not None else None
    written = write_sweep_page(
        store, table=table["sweep"], computed=computed, published=published, name=project.project.name
    )
    return publish_sweep(store, project, computed, table, written)


def _prepared(variants: Mapping[str, Project], store: Store) -> dict[str, PreparedBlock]:
    """The block of each variant; variants that differ only in the adjustment share it."""
    prepared: dict[str, PreparedBlock] = {}
    for name, variant in variants.items():
        alike = (other for other in prepared if _read_alike(variants[other], variant))
        first = next(alike, None)
        prepared[name] = prepare_block(variant, store) if first is None else prepared[first]
    return prepared


def _read_alike(one: Project, other: Project) -> bool:
    """Whether two variants read the same files in the same way."""
    tables = ("project", "cameras", "inputs", "checks")
    return all(getattr(one, table) == getattr(other, table) for table in tables)


@dataclass(frozen=True)
class _Case:
    """A scenario with all it needs, and the keyword arguments of its stages."""

    scenario: Scenario
    sweep: SweepSettings
    project: Project
    block: PreparedBlock

    def images(self) -> dict[str, object]:
        """Arguments of `select_images`."""
        name = self.scenario.block
        return {
            "images": self.block.approximate["images"],
            "image_points": self.block.tables["image_points"],
            "block": self.sweep.blocks[name],
            "name": name,
        }

    def roles(self) -> dict[str, object]:
        """Arguments of `assign_roles`."""
        name = self.scenario.control
        return {
            "control_points": self.block.tables["control_points"],
            "image_points": self.block.tables["image_points"],
            "control": self.sweep.control[name],
            "name": name,
            "project": self.project.project,
        }

    def inputs(self, images: Outputs, roles: Outputs) -> dict[str, object]:
        """Common arguments of `approximate_block` and `adjust_bundle`."""
        return {
            **self.block.tables,
            "image_points": images["image_points"],
            "control_points": roles["control_points"],
            "project": self.project.project,
        }


def _computed(cases: Sequence[_Case], store: Store, executor: Executor | None) -> tuple[Computed, ...]:
    """Choose images and control points, find approximate values and adjust, for every scenario."""
    images = select_images.map([case.images() for case in cases], store)
    roles = assign_roles.map([case.roles() for case in cases], store)
    inputs = [case.inputs(*chosen) for case, *chosen in zip(cases, images, roles, strict=True)]
    starts = approximate_block.attempt(
        [
            {
                **given,
                "checks": case.project.checks,
                "misaligned": not MOUNTINGS.isdisjoint(case.project.adjustment.free),
            }
            for case, given in zip(cases, inputs, strict=True)
        ],
        store,
        executor=executor,
    )
    arguments = {
        index: {
            **inputs[index],
            **{name: start[name] for name in _APPROXIMATE},
            "adjustment": cases[index].project.adjustment,
        }
        for index, start in enumerate(starts)
        if not isinstance(start, AerocalError)
    }
    adjusted = adjust_bundle.attempt(
        list(arguments.values()),
        store,
        executor=executor,
        when_done=_progress([cases[index].scenario for index in arguments]),
    )
    ends = dict(zip(arguments, adjusted, strict=True))
    return tuple(
        Computed.of(case.scenario, [case.block.exposures, start, *([ends[index]] if index in ends else [])])
        for index, (case, start) in enumerate(zip(cases, starts, strict=True))
    )


def _progress(plan: Sequence[Scenario]) -> Callable[[int, Attempt[Outputs]], None]:
    """Reports after each adjustment how many are done, and the result."""
    done: list[int] = []

    def say(index: int, outcome: Attempt[Outputs]) -> None:
        done.append(index)
        _log.info("sweep: %d of %d: %s", len(done), len(plan), in_one_line(plan[index], outcome))

    return say
