"""The stages of all stories, one row for each, and what has become of them in a run.

The order suits every story. On the production page, a stage is done, reused, failed, running or still
waiting.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.production.run_record import SWEEP, RunRecord, StageTime
from tasks.store.stage_record import read_records
from tasks.store.store import Store

TRIANGULATION, CALIBRATION = "aerial-triangulation", "system-calibration"
CHECK, IMAGE_QUALITY = "direct-georeferencing-check", "image-quality"
_BLOCKS = (TRIANGULATION, CALIBRATION, CHECK, SWEEP)


@dataclass(frozen=True)
class StageRow:
    """A stage as the production page shows it.

    Attributes
    ----------
    name : as in the store (`tasks.store.store.stored`).
    label : head of its column.
    always : stories that come to it whatever their project file says.
    often : stories that may do without it, and usually do not.

    Other stories show it once they have come to it.
    """

    name: str
    label: str
    always: tuple[str, ...] = ()
    often: tuple[str, ...] = ()


STAGES: Mapping[str, StageRow] = {
    row.name: row
    for row in (
        StageRow("import_exposures", "exposures", _BLOCKS, (IMAGE_QUALITY,)),
        StageRow("import_control", "control", _BLOCKS),
        StageRow("import_image_points", "image points", _BLOCKS),
        StageRow("film_orientations", "film"),
        StageRow("approximate_values", "approximate", _BLOCKS),
        StageRow("sub_block", "sub-blocks", often=(SWEEP,)),
        StageRow("control_roles", "control roles", often=(SWEEP,)),
        StageRow("bundle_adjustment", "adjustment", (TRIANGULATION, CALIBRATION, SWEEP), (CHECK,)),
        StageRow("judgement", "judgement", (CALIBRATION,)),
        StageRow("remarks", "remarks", (TRIANGULATION, CALIBRATION), (CHECK,)),
        StageRow("trust_map", "trust map"),
        StageRow("calibrated_cameras", "cameras", often=(CALIBRATION,)),
        StageRow("two_step", "two steps", often=(CALIBRATION,)),
        StageRow("platform", "platform"),
        StageRow("calibration", "calibration", (CALIBRATION,)),
        StageRow("virtual_images", "virtual images"),
        StageRow("burn_in_protocol", "burn-in"),
        StageRow("statements", "statements"),
        StageRow("direct_georeferencing", "direct check", (CALIBRATION, CHECK)),
        StageRow("georeferencing_page", "check page", (CALIBRATION, CHECK)),
        StageRow("report", "report", (TRIANGULATION, CALIBRATION), (CHECK,)),
        StageRow("certificate", "certificate", (CALIBRATION,)),
        StageRow("sweep_table", "sweep table", (SWEEP,)),
        StageRow("sweep_page", "sweep page", (SWEEP,)),
        StageRow("image_quality", "edges, noise", often=(IMAGE_QUALITY,)),
        StageRow("smear_motion", "smear", often=(IMAGE_QUALITY,)),
        StageRow("sensor_quality", "sensor", often=(IMAGE_QUALITY,)),
        StageRow("drift", "drift", often=(IMAGE_QUALITY,)),
        StageRow("image_quality_page", "quality page", (IMAGE_QUALITY,)),
        StageRow("radiometric_certificate", "radiometric certificate", often=(IMAGE_QUALITY,)),
    )
}


def stages_of(story: str) -> tuple[str, ...]:
    """The stages that a story is expected to come to, in their order; empty: no story of ours."""
    return tuple(row.name for row in STAGES.values() if story in row.always or story in row.often)


StageState: TypeAlias = Literal["done", "reused", "failed", "running", "waiting"]


def stage_states(run: RunRecord, done: Sequence[StageTime]) -> dict[str, StageState]:
    """The state of every stage of a run; stages that its story lacks or skipped are missing.

    Parameters
    ----------
    done : the stages that have ended; of a run in work those so far (`stages_so_far`).
    """
    states: dict[str, StageState] = {}
    for stage in dict.fromkeys(one.stage for one in done):
        reused = all(one.reused for one in done if one.stage == stage)
        states[stage] = "reused" if reused else "done"
    expected = stages_of(run.story)
    if run.failed_stage is not None:
        states[run.failed_stage] = "failed"
    elif run.state == "Running" and (ahead := _ahead(expected, states)):
        # Whether an optional stage is gone into is not known before it has ended.
        certain = (stage for stage in ahead if run.story in STAGES[stage].always)
        states[next(certain, ahead[0])] = "running"
    if run.state not in ("Completed", "GateFailed"):
        states = {**dict.fromkeys(expected, "waiting"), **states}
    known = {stage: place for place, stage in enumerate(STAGES)}
    return dict(sorted(states.items(), key=lambda one: known.get(one[0], len(known))))


def stages_so_far(run: RunRecord) -> tuple[StageTime, ...]:
    """The finished stages of an active run, according to its output folder."""
    if not run.directory:
        return ()
    return stages_since(Path(run.directory), run.begun)


def stages_since(directory: Path, begun: datetime | None) -> tuple[StageTime, ...]:
    """The stages of the current run of an output folder, if it began then or later.

    A run that waits for another one's end, or was refused before its first stage, has left the records of the
    run before it in the folder.
    """
    try:
        records = read_records(Store.of(directory).folder)
        return tuple(
            StageTime(one.stage, one.seconds, one.reused, one.key)
            for one in records
            if begun is None or datetime.fromisoformat(one.started) >= begun
        )
    except (OSError, ValueError, TypeError):
        # Just being emptied by a run that begins, or somebody's own file.
        return ()


def _ahead(expected: Iterable[str], ended: Mapping[str, StageState]) -> tuple[str, ...]:
    """The stages after the last finished one."""
    order = tuple(expected)
    reached = [place for place, stage in enumerate(order) if stage in ended]
    return order[max(reached) + 1 :] if reached else order
