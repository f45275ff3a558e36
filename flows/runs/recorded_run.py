"""A run of a project in the production records: noted when it begins and when it has ended.

Without records (``aerocal run`` on its own) it is an ordinary run. Records that cannot be written are
reported and stop no adjustment; missing entries are completed from the server's own records
(`flows.server.watch`).
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from tasks.errors import AerocalError
from tasks.files.installation import InstallationError
from tasks.patience import Patience
from tasks.production.notice import KINDS, Notice
from tasks.production.records import configured_records, write_notice
from tasks.production.run_record import (
    OVERVIEW_VARIABLE,
    PUBLISHING,
    RECORDS_VARIABLE,
    RunFigures,
    RunRecord,
    State,
)
from tasks.production.stages import stages_since
from tasks.store.stage_record import utc_now

_log = logging.getLogger("aerocal")

#: How long a database that does not answer is waited for, s: before an adjustment hardly, with its result
#: until a server that was started again must be back.
_PATIENCE_BEGINNING = Patience(1.0, 15.0, 10.0)
_PATIENCE_END = Patience(1.0, 15.0, 180.0)


@dataclass(frozen=True)
class FlowRunIdentity:
    """The identity of a run on the server.

    Attributes
    ----------
    id : of the flow run.
    story : name of the flow.
    deployed : whether a runner can begin it again; no other one says so.
    """

    id: str
    story: str
    deployed: bool = True


def carry_out_recorded(story: Story, request: RunRequest, identity: FlowRunIdentity) -> RunOutcome:
    """Run a story on a project and record its outcome.

    Raises
    ------
    InstallationError
        If the machine prevents the run.
    """
    records = configured_records()
    if records is None:
        return carry_out(story, request)
    # As exact as the records of the stages are, none of which may seem older.
    begun = datetime.fromisoformat(utc_now())
    project_file, directory = request.project_file.absolute(), str(request.directory.absolute())
    run = RunRecord.of(identity.id, project_file, identity.story, "Running", directory=directory)
    _noted(lambda: records.begin(run), _PATIENCE_BEGINNING)

    def ended(state: State, message: str, **more: Any) -> None:
        stages = stages_since(request.directory, begun)
        _noted(lambda: records.end(identity.id, state, message, stages=stages, **more), _PATIENCE_END)

    try:
        outcome = carry_out(story, request)
    except AerocalError as error:
        ended("Failed", str(error), failed_stage=error.stage, may_pass=identity.deployed)
        raise
    except (OSError, MemoryError) as error:
        message = f"Failure of the machine: {type(error).__name__}: {error}."
        ended("Failed", message, may_pass=identity.deployed)
        raise
    except Exception as error:
        ended("Failed", f"A defect of aerocal: {type(error).__name__}: {error}")
        raise
    summary = {name: value for name, value in outcome.summary.to_json().items() if name != "timings_s"}
    ended(outcome.state, outcome.message, failed_stage=outcome.failed_stage, summary=summary)
    return outcome


def refused_run(project: str | Path, state: State, message: str, identity: FlowRunIdentity) -> RunRecord:
    """A run that has ended before it began.

    Parameters
    ----------
    project : its file; a text: as given, where there is none.
    """
    run = RunRecord.of(identity.id, Path(project), identity.story, state, message)
    return run if isinstance(project, Path) else replace(run, project=project, project_file="")


def note_refusal(run: RunRecord) -> None:
    """Record a run that was refused."""
    records = configured_records()
    if records is None:
        return

    def write() -> None:
        records.begin(run)
        records.end(run.id, run.state, run.message)

    _noted(write, _PATIENCE_END)


def tell_without_record(identity: FlowRunIdentity, about: str, state: str, message: str) -> None:
    """Put into the outbox how a run has ended that is of no project (of the registry, of the inbox)."""
    records = configured_records()
    if records is None:
        return
    # Without a record nobody knows whether the run has been told before; so it is told once.
    notice = Notice(
        f"{identity.id}:{state}",
        KINDS[state],
        identity.id,
        about,
        identity.story,
        state,
        message,
        "",
        utc_now(),
    )

    def write() -> None:
        with records.writing() as connection:
            write_notice(connection, notice)

    _noted(write, _PATIENCE_END)


def _noted(write: Callable[[], None], patience: Patience) -> None:
    """Write into the records; retried while their database does not answer."""
    try:
        patience.tried(write, lambda error: isinstance(error, InstallationError))
    except AerocalError as error:
        _log.warning("the record of runs could not be written: %s", error)


def ended_run(outcome: RunOutcome, identity: FlowRunIdentity) -> RunRecord:
    """A run that has ended with an outcome, as the dashboard shows it."""
    problems = outcome.summary.problems if outcome.state in PUBLISHING else ()
    place = outcome.place.absolute() if isinstance(outcome.place, Path) else outcome.place
    file, figures = outcome.request.project_file.absolute(), RunFigures(problems=problems)
    more = {"directory": str(place), "figures": figures}
    return RunRecord.of(identity.id, file, identity.story, outcome.state, outcome.message, **more)


def configured_overview(environment: Mapping[str, str] = os.environ) -> str | None:
    """Address of the production page that shows the runs of this process; None: there is none."""
    base = environment.get(OVERVIEW_VARIABLE)
    return base.rstrip("/") if base and environment.get(RECORDS_VARIABLE) else None
