"""What the server knows of flow runs, and how it is told something else."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from flows.serving.api import Api
from tasks.production.run_record import ENDED, State

_BATCH = 100
#: States of the server by type, where their names are none of a record's.
_BY_TYPE: Mapping[str, State] = {
    "COMPLETED": "Completed",
    "FAILED": "Failed",
    "CRASHED": "Crashed",
    "CANCELLED": "Cancelled",
}


@dataclass(frozen=True)
class FlowRun:
    """A run as the server knows it.

    Attributes
    ----------
    id : its number.
    type, name, message : of its state.
    since : when it came into that state, UTC.
    deployed : whether it belongs to a deployment, so that a runner can begin it again.
    flow : number of its flow.
    parameters : as it was asked for.
    """

    id: str
    type: str
    name: str
    message: str
    since: datetime
    deployed: bool
    flow: str
    parameters: Mapping[str, Any]

    @property
    def end(self) -> State | None:
        """How it has ended; None: it has not."""
        if self.type not in _BY_TYPE:
            return None
        return self.name if self.name in ENDED else _BY_TYPE[self.type]  # type: ignore[return-value]

    @property
    def age_s(self) -> float:
        """Seconds that it has been in its state."""
        return (datetime.now(UTC) - self.since).total_seconds()


def flow_runs(api: Api, ids: Sequence[str]) -> dict[str, FlowRun]:
    """The runs with these numbers that the server knows."""
    found: dict[str, FlowRun] = {}
    for first in range(0, len(ids), _BATCH):
        found |= _asked(api, {"id": {"any_": list(ids[first : first + _BATCH])}}, "ID_DESC", _BATCH)
    return found


def flow_runs_in(api: Api, types: Collection[str], since: datetime) -> dict[str, FlowRun]:
    """The latest runs in a state of these types, of those that were expected to begin after a time."""
    wanted = {
        "state": {"type": {"any_": sorted(types)}},
        "expected_start_time": {"after_": since.isoformat()},
    }
    return _asked(api, wanted, "EXPECTED_START_TIME_DESC", 200)


def _asked(api: Api, wanted: Mapping[str, Any], sort: str, limit: int) -> dict[str, FlowRun]:
    answer = api.post("/flow_runs/filter", {"flow_runs": wanted, "sort": sort, "limit": limit})
    return {run["id"]: _flow_run(run) for run in answer if run.get("state") is not None}


def _flow_run(answer: Mapping[str, Any]) -> FlowRun:
    state = answer["state"]
    return FlowRun(
        answer["id"],
        state["type"],
        state["name"],
        str(state.get("message") or state["name"]),
        datetime.fromisoformat(state["timestamp"]),
        answer.get("deployment_id") is not None,
        answer["flow_id"],
        answer.get("parameters") or {},
    )


def set_state(api: Api, run_id: str, kind: str, name: str, message: str, *, force: bool) -> bool:
    """Tell the server that a run is in another state; whether it is now.

    Parameters
    ----------
    kind, name, message : of the state.
    force : also where the server's rules, by which a run that has ended stays so, are against it.
    """
    state = {"type": kind, "name": name, "message": message}
    answer = api.post(f"/flow_runs/{run_id}/set_state", {"state": state, "force": force})
    return bool(answer["status"] == "ACCEPT")
