"""Runs that the machine has ended are begun again; finished stages are kept."""

from __future__ import annotations

from datetime import UTC, datetime

from flows.serving.api import Api
from flows.serving.flow_runs import flow_runs, set_state
from tasks.production.records import Records
from tasks.production.run_record import RunRecord

_MESSAGE = "It was ended by the machine; finished stages are kept."


def begin_again(api: Api, records: Records) -> tuple[RunRecord, ...]:
    """Schedule the runs again that are due (`tasks.production.attempts`).

    One that belongs to no deployment (it was started by a command, which has ended with it) cannot be begun
    by a runner; it stays as it ended.

    Returns
    -------
    begun : the runs that wait for a runner now.

    Raises
    ------
    InstallationError
        If server or records cannot be reached.
    """
    due = records.due(datetime.now(UTC))
    if not due:
        return ()
    known = flow_runs(api, [run.id for run in due])
    begun = []
    for run in due:
        found = known.get(run.id)
        if found is None or not found.deployed:
            records.give_up(run.id)
        elif found.type in ("CRASHED", "FAILED") and records.begin_again(run, _MESSAGE):
            # Whoever has got the record may tell the server: nobody else will.
            set_state(api, run.id, "SCHEDULED", "AwaitingRetry", _MESSAGE, force=True)
            begun.append(run.id)
    return records.runs_with(begun)
