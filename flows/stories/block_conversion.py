"""Block conversion: the deliveries of a project in a block exchange format, without an adjustment."""

from __future__ import annotations

from pathlib import Path

from flows.stories.block_preparation import prepare_block
from tasks.handover.export import Export
from tasks.handover.unadjusted import convert_block
from tasks.settings.project import Project
from tasks.store.notes import read_notes
from tasks.store.stage_record import read_records
from tasks.store.store import Store


def converted_block(
    project: Project, store: Store, to: str, out: Path, world: str | None
) -> tuple[Export, tuple[str, ...]]:
    """Read the deliveries, find approximate values, write the block; also returns what looked wrong."""
    block = prepare_block(project, store)
    outputs = {name: artifact for one in block.stages for name, artifact in one.items()}
    sentences = (sentence for one in block.stages for sentence in read_notes(one["notes"]).problems)
    # Orientations and control of one file may have the same ones.
    remarks = tuple(dict.fromkeys(sentences))
    delivered = {path for record in read_records(store.folder) for path in record.inputs}
    return convert_block(outputs, project.project, to, out, world, delivered), remarks
