"""The stages of a run on the production page: done, reused, failed, running or still to come."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.production.run_record import RunRecord, StageTime
from tasks.production.stages import STAGES, stages_of
from tasks.store.stage_record import read_records
from tasks.store.store import Store

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
            StageTime(one.stage, one.seconds, one.reused)
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
