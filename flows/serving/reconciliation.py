"""The records of production brought into line with what the server knows.

A run writes its own end. One that was killed, cancelled or timed out cannot; the server hears of it (from the
runner, or because its heartbeats have stopped), and here the record learns it, too. A run that the server no
longer knows, because its database was lost or begun anew, is given up: its delivery then gets another one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flows.serving.api import Api
from tasks.production.records import Records
from tasks.production.run_record import ENDED, RunRecord, State

_BATCH = 100
#: States of the server that are not ended, as those of a record.
_OPEN: Mapping[str, State] = {"RUNNING": "Running", "SCHEDULED": "Scheduled"}
#: States of the server by type, where their names are none of a record's.
_BY_TYPE: Mapping[str, State] = {
    "COMPLETED": "Completed",
    "FAILED": "Failed",
    "CRASHED": "Crashed",
    "CANCELLED": "Cancelled",
}


def reconcile(api: Api, records: Records) -> tuple[RunRecord, ...]:
    """Bring the records of unfinished runs into line with the server.

    Returns
    -------
    mended : the runs whose end was not noted by themselves, with that end.

    Raises
    ------
    InstallationError
        If server or records cannot be reached.
    """
    unfinished = records.runs(states=("Scheduled", "Running"))
    known = _known(api, [run.id for run in unfinished])
    mended: list[str] = []
    for run in unfinished:
        found = known.get(run.id)
        if found is None:
            records.end(run.id, "Crashed", "The server no longer knows this run.")
            mended.append(run.id)
        elif (state := _ended_state(found)) is not None:
            records.end(run.id, state, _message(found))
            mended.append(run.id)
        elif run.state == "Running" and _OPEN.get(found["state_type"]) == "Scheduled":
            records.reschedule(run.id, _message(found))
    return tuple(record for run_id in mended if (record := records.run(run_id)) is not None)


def _known(api: Api, ids: list[str]) -> dict[str, Mapping[str, Any]]:
    """The server's records of runs, by their numbers."""
    found: dict[str, Mapping[str, Any]] = {}
    for first in range(0, len(ids), _BATCH):
        asked = {"flow_runs": {"id": {"any_": ids[first : first + _BATCH]}}, "limit": _BATCH}
        found |= {run["id"]: run for run in api.post("/flow_runs/filter", asked)}
    return found


def _ended_state(found: Mapping[str, Any]) -> State | None:
    name, kind = str(found["state_name"]), str(found["state_type"])
    if kind not in _BY_TYPE:
        return None
    return name if name in ENDED else _BY_TYPE[kind]  # type: ignore[return-value]


def _message(found: Mapping[str, Any]) -> str:
    return str((found.get("state") or {}).get("message") or found["state_name"])
