"""The stages of a run as the overview shows them: what is done, reused, failed, in work or still to come."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.production.run_record import SWEEP, RunRecord, StageTime
from tasks.store.stage_record import read_records
from tasks.store.store import Store

StageState: TypeAlias = Literal["done", "reused", "failed", "running", "waiting"]

_PREPARATION = ("import_exposures", "import_control", "import_image_points", "approximate_values")
_ADJUSTMENT = ("bundle_adjustment", "remarks")
_CHECK = ("direct_georeferencing", "georeferencing_page")
#: The stages of each story, in the order in which it comes to them for the first time.
STAGES_OF: Mapping[str, tuple[str, ...]] = {
    "aerial-triangulation": (*_PREPARATION, *_ADJUSTMENT, "report"),
    "system-calibration": (
        *_PREPARATION,
        "bundle_adjustment",
        "judgement",
        "remarks",
        "calibrated_cameras",
        "two_step",
        "calibration",
        *_CHECK,
        "report",
        "certificate",
    ),
    "direct-georeferencing-check": (*_PREPARATION, *_ADJUSTMENT, *_CHECK, "report"),
    "image-quality": (
        "import_exposures",
        "image_quality",
        "smear_motion",
        "sensor_quality",
        "drift",
        "image_quality_page",
        "radiometric_certificate",
    ),
    SWEEP: (*_PREPARATION, "sub_block", "control_roles", "bundle_adjustment", "sweep_table", "sweep_page"),
}
#: All of them, in an order that suits every story.
STAGES: tuple[str, ...] = (
    *_PREPARATION,
    "sub_block",
    "control_roles",
    *STAGES_OF["system-calibration"][len(_PREPARATION) :],
    "sweep_table",
    "sweep_page",
    *STAGES_OF["image-quality"][1:],
)
#: Those that a story may do without, as the project file wants it.
_OPTIONAL: Mapping[str, frozenset[str]] = {
    "system-calibration": frozenset(("calibrated_cameras", "two_step")),
    "direct-georeferencing-check": frozenset((*_ADJUSTMENT, "report")),
    SWEEP: frozenset(("sub_block", "control_roles")),
    "image-quality": frozenset(STAGES_OF["image-quality"]) - {"image_quality_page"},
}


def stage_states(run: RunRecord, done: Sequence[StageTime]) -> dict[str, StageState]:
    """The state of every stage of a run; stages that its story does not have, or went without, are missing.

    Parameters
    ----------
    done : the stages that have ended; of a run in work those so far (`stages_so_far`).
    """
    states: dict[str, StageState] = {}
    for stage in dict.fromkeys(one.stage for one in done):
        reused = all(one.reused for one in done if one.stage == stage)
        states[stage] = "reused" if reused else "done"
    expected = STAGES_OF.get(run.story, ())
    if run.failed_stage is not None:
        states[run.failed_stage] = "failed"
    elif run.state == "Running" and (ahead := _ahead(expected, states)):
        optional = _OPTIONAL.get(run.story, frozenset())
        # Whether an optional stage is gone into is not known before it has ended.
        states[next((stage for stage in ahead if stage not in optional), ahead[0])] = "running"
    if run.state not in ("Completed", "GateFailed"):
        states = {**dict.fromkeys(expected, "waiting"), **states}
    known = {stage: place for place, stage in enumerate(STAGES)}
    return dict(sorted(states.items(), key=lambda one: known.get(one[0], len(known))))


def stages_so_far(run: RunRecord) -> tuple[StageTime, ...]:
    """The stages that a run in work has ended, as its output folder tells."""
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
            StageTime(one.stage, one.seconds, one.reused)
            for one in records
            if begun is None or datetime.fromisoformat(one.started) >= begun
        )
    except (OSError, ValueError, TypeError):
        # Just being emptied by a run that begins, or somebody's own file.
        return ()


def _ahead(expected: Iterable[str], ended: Mapping[str, StageState]) -> tuple[str, ...]:
    """The stages behind the last one that has ended."""
    order = tuple(expected)
    reached = [place for place, stage in enumerate(order) if stage in ended]
    return order[max(reached) + 1 :] if reached else order
