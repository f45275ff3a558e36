"""The record of one run of a story, and when it is restarted automatically.

Prefect retries within a run, and forgets runs; how a delivery has ended is remembered here. A run that the
machine has ended says nothing about its project, so it is started again: at once, because most causes pass
with the process that was killed, then after growing pauses. A full disk takes somebody to make room; it is
tried again less often and for longer. What ended the machine's patience every time (an adjustment that
needs more memory than there is) must not go round for ever: then the run stays as it ended.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, OnErrorOmit, ValidationError, ValidatorFunctionWrapHandler, WrapValidator

from tasks.results.quality_gates import GateResult

#: Set by ``aerocal serve`` for its runner and what the runner starts: address of the records.
RECORDS_VARIABLE = "AEROCAL_RECORDS"
#: Set likewise: address of the production page, which serves the documents of runs.
OVERVIEW_VARIABLE = "AEROCAL_OVERVIEW_URL"

#: States of a run: those of the dashboard (docs/operations.md), without what only the server knows.
State: TypeAlias = Literal[
    "Scheduled",
    "Running",
    "Completed",
    "GateFailed",
    "InputError",
    "NotComputable",
    "Failed",
    "TimedOut",
    "Crashed",
    "Cancelled",
]
#: States in which nothing more happens by itself.
ENDED: frozenset[str] = frozenset(
    ("Completed", "GateFailed", "InputError", "NotComputable", "Failed", "TimedOut", "Crashed", "Cancelled")
)
#: Ends that say something about the delivery: the same input would end alike. After the others the machine
#: or somebody is to blame, and the delivery still waits for its run.
DECIDED: frozenset[str] = frozenset(("Completed", "GateFailed", "InputError", "NotComputable"))

#: The story that publishes files of its own next to those of the others.
SWEEP = "scenario-sweep"
#: Ends after which the output folder holds the results of the run.
PUBLISHING: tuple[State, ...] = ("Completed", "GateFailed")


@dataclass(frozen=True)
class StageTime:
    """A stage of a run that has ended.

    Attributes
    ----------
    stage : its name.
    seconds : that it took.
    reused : whether its output was there already.
    key : of that output in the store; "": an earlier version has not noted it.
    """

    stage: str
    seconds: float
    reused: bool
    key: str = ""


def _otherwise(missing: object) -> WrapValidator:
    """What stands for a figure that is null, or that this version does not understand."""

    def read(figure: Any, understood: ValidatorFunctionWrapHandler) -> Any:
        try:
            return understood(figure)
        except ValidationError:
            return missing

    return WrapValidator(read)


#: x, y, z; None where there is no figure.
Axes: TypeAlias = tuple[float | None, float | None, float | None]
NO_AXES: Axes = (None, None, None)
_Figure: TypeAlias = Annotated[float | None, _otherwise(None)]


class RunFigures(BaseModel, frozen=True):
    """What pages and notices show of a summary.json, of whatever version; see docs/artifacts.md."""

    sigma0: _Figure = None
    rmse_check_m: Annotated[Axes, _otherwise(NO_AXES)] = NO_AXES
    trust_map_plan_m: _Figure = None
    trust_map_height_m: _Figure = None
    gates: Annotated[tuple[OnErrorOmit[GateResult], ...], _otherwise(())] = ()
    problems: Annotated[tuple[str, ...], _otherwise(())] = ()


@dataclass(frozen=True)
class RunRecord:
    """A run.

    Attributes
    ----------
    id : of the flow run.
    project : name of the project for people: that of its folder.
    project_file, directory : the project's file and the output folder; "" for what is not known yet.
    story : what is done, as the dashboard writes it (``aerial-triangulation``).
    state : see `State`.
    message : one or several sentences on the state.
    scheduled, begun, ended : UTC; None: not yet.
    delivery : key of the delivery it is for; None: started by hand.
    host, process : machine (`tasks.files.machine`) and process that it runs or ran in; None: nowhere yet.
    attempts : how often it was started, or is to be, since somebody or a delivery requested it.
    again_at : when it is started again by itself, UTC; None: it is not, or has not ended.
    stages : those that have ended, in the order in which they did.
    failed_stage : the one that could not be done; None: none, or it is not known.
    figures : of its summary.json; empty until the end.
    """

    id: str
    project: str
    project_file: str
    directory: str
    story: str
    state: State
    message: str
    scheduled: datetime
    begun: datetime | None = None
    ended: datetime | None = None
    delivery: str | None = None
    host: str | None = None
    process: int | None = None
    attempts: int = 1
    again_at: datetime | None = None
    stages: tuple[StageTime, ...] = ()
    failed_stage: str | None = None
    figures: RunFigures = field(default_factory=RunFigures)

    @classmethod
    def of(
        cls, run_id: str, project_file: Path, story: str, state: State, message: str = "", **more: Any
    ) -> RunRecord:
        """The run of a project, scheduled now if `more` states no other time."""
        known = {"directory": "", "scheduled": datetime.now(UTC), **more}
        name = project_name(project_file)
        return cls(run_id, name, str(project_file), story=story, state=state, message=message, **known)

    @property
    def has_ended(self) -> bool:
        """Whether nothing further happens automatically."""
        return self.state in ENDED and self.again_at is None


def project_name(project_file: Path) -> str:
    """Name of a project: its folder, or its file if that is not called ``project.toml``."""
    if project_file.name == "project.toml" and project_file.parent.name:
        return project_file.parent.name
    return project_file.stem if project_file.suffix == ".toml" else project_file.name


_MINUTE = 60
_HOUR = 3600

#: Seconds before the second, third, … beginning, by the state that the one before has ended in.
PAUSES_S: Mapping[State, tuple[int, ...]] = {
    "Crashed": (0, 30, 2 * _MINUTE, 10 * _MINUTE),
    "Failed": (_MINUTE, 5 * _MINUTE, 15 * _MINUTE, _HOUR, _HOUR, _HOUR, _HOUR, _HOUR),
}
LONGEST_PAUSE_S = max(pause for pauses in PAUSES_S.values() for pause in pauses)


def ending(attempts: int, state: State, message: str, *, may_pass: bool) -> dict[str, object]:
    """What is noted of every end: its state, and when the run is started again by itself.

    Parameters
    ----------
    attempts : how often it was started.
    may_pass : whether the reason may be gone another time; then the message says what happens next.
    """
    now, again_at = datetime.now(UTC), None
    pauses = PAUSES_S.get(state, ()) if may_pass else ()
    if attempts <= len(pauses):
        again_at = now + timedelta(seconds=pauses[attempts - 1])
        message += f" It is restarted after {again_at:%H:%M} UTC."
    elif pauses:
        times = "once" if attempts == 1 else f"{attempts} times"
        message += f" It was started {times} and is not restarted automatically."
    return {"state": state, "ended": now, "message": message, "again_at": again_at}


def given_up(message: str) -> dict[str, object]:
    """What is noted of an end with this message after which the run is not started again after all."""
    said = re.sub(r" It is restarted after \d\d:\d\d UTC\.$", "", message)
    return {"message": f"{said} It is not restarted automatically.", "again_at": None}
