"""Requests to the server's API without loading Prefect, which takes seconds.

Runs and their states; and the automation that ends runs whose signs of life have stopped. A run says every
half minute (`HEARTBEAT_S` of `flows.server.prefect_settings`) that it lives; so does one that is started by
hand and reported to the server. If its machine dies, nobody else can tell. The automation lives in the
server, so that it applies to runs on every machine; it changes no run that has ended.
"""

from __future__ import annotations

import json
import os
import urllib.request
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, cast
from urllib.error import HTTPError

from flows.server.door import basic
from flows.server.server_process import CLIENT_PASSWORD
from tasks.files.installation import InstallationError
from tasks.patience import Patience
from tasks.production.run_record import ENDED, State

#: With a call that finds the server's database busy.
_PATIENCE = Patience(0.5, 4.0, 7.5)


@dataclass(frozen=True)
class Api:
    """The API of a Prefect server.

    Attributes
    ----------
    url : its address, with ``/api``.
    password : ``user:password`` it asks for; None: it does not ask.
    """

    url: str
    password: str | None = None

    def get(self, path: str) -> Any:
        """Read something; None if it does not exist.

        Raises
        ------
        InstallationError
            If the server cannot be reached, or refuses.
        """
        return self.call("GET", path, None)

    def post(self, path: str, body: Mapping[str, Any] | Sequence[Any]) -> Any:
        """Post a request; returns the answer. Raises the errors of `get`."""
        return self.call("POST", path, body)

    def is_well(self) -> bool:
        """Whether the server answers."""
        try:
            self.ask("/health", timeout_s=5.0)
        except OSError:
            return False
        return True

    def ask(
        self,
        path: str,
        method: str = "GET",
        body: Mapping[str, Any] | Sequence[Any] | None = None,
        timeout_s: float = 30.0,
    ) -> bytes:
        """The answer to one request; raises what `urllib` raises."""
        headers = {"Content-Type": "application/json"}
        if self.password is not None:
            headers["Authorization"] = basic(self.password)
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.url}{path}", data, headers, method=method)
        with urllib.request.urlopen(request, timeout=timeout_s) as answer:
            return bytes(answer.read())

    def call(self, method: str, path: str, body: Mapping[str, Any] | Sequence[Any] | None = None) -> Any:
        """Request something by another method. Raises the errors of `get`."""
        try:
            # A request to a busy database (503: nothing was done) is repeated a few times.
            text = _PATIENCE.tried(
                lambda: self.ask(path, method, body),
                _is_busy,
                lambda error, *_: cast(HTTPError, error).close(),
            )
        except HTTPError as error:
            with error:
                if error.code == 404 and method == "GET":
                    return None
                said = error.read(2000).decode(errors="replace")
            raise InstallationError(
                f"The server {self.url} refused {path} ({error.code}): {said}", "See its log."
            ) from error
        except OSError as error:
            raise InstallationError(
                f"The server {self.url} does not answer ({error}).", "See its log."
            ) from error
        return json.loads(text) if text else None


def _is_busy(error: Exception) -> bool:
    return isinstance(error, HTTPError) and error.code == 503


def configured_api(environment: Mapping[str, str] = os.environ) -> Api:
    """The API that runs of this process are reported to."""
    return Api(environment["PREFECT_API_URL"].rstrip("/"), environment.get(CLIENT_PASSWORD))


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
    parameters : as it was requested.
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
        """Time it has been in its state, seconds."""
        return (datetime.now(UTC) - self.since).total_seconds()


def flow_runs(api: Api, ids: Sequence[str]) -> dict[str, FlowRun]:
    """The runs with these numbers that the server knows."""
    found: dict[str, FlowRun] = {}
    for first in range(0, len(ids), _BATCH):
        found |= _found(api, {"id": {"any_": list(ids[first : first + _BATCH])}}, "ID_DESC", _BATCH)
    return found


def flow_runs_in(api: Api, types: Collection[str], since: datetime) -> dict[str, FlowRun]:
    """The latest runs in a state of these types, of those that were expected to begin after a time."""
    wanted = {
        "state": {"type": {"any_": sorted(types)}},
        "expected_start_time": {"after_": since.isoformat()},
    }
    return _found(api, wanted, "EXPECTED_START_TIME_DESC", 200)


def _found(api: Api, wanted: Mapping[str, Any], sort: str, limit: int) -> dict[str, FlowRun]:
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


def set_state(api: Api, run_id: str, kind: str, name: str, message: str, *, force: bool) -> None:
    """Set the state of a run on the server, unless its rules are against it.

    Parameters
    ----------
    kind, name, message : of the state.
    force : also where the rules, by which a run that has ended stays so, are against it.
    """
    state = {"type": kind, "name": name, "message": message}
    api.post(f"/flow_runs/{run_id}/set_state", {"state": state, "force": force})


#: Name of the silence_automation; one of this name that differs is replaced.
AUTOMATION = "aerocal: runs without heartbeat"
#: Seconds without any event of a run after which it counts as ended: four heartbeats.
SILENCE_S = 120


def watch_heartbeats(api: Api) -> None:
    """Make sure that the server has the silence_automation exactly once, in its present form.

    Raises
    ------
    InstallationError
        If the server cannot be reached, or refuses.
    """
    meant = silence_automation()
    found = api.post("/automations/filter", {"automations": {"name": {"any_": [AUTOMATION]}}, "limit": 10})
    for one in found[1:]:
        api.call("DELETE", f"/automations/{one['id']}")
    if not found:
        api.post("/automations/", meant)
    elif not _holds(found[0], meant):
        api.call("PUT", f"/automations/{found[0]['id']}", meant)


def silence_automation() -> dict[str, Any]:
    """The silence_automation as the server's API takes it."""
    return {
        "name": AUTOMATION,
        "description": f"A run without a heartbeat for {SILENCE_S} s is Crashed; made by aerocal serve.",
        "enabled": True,
        "trigger": {
            "type": "event",
            "posture": "Proactive",
            "match": {"prefect.resource.id": "prefect.flow-run.*"},
            "after": ["prefect.flow-run.heartbeat"],
            # The names of our own states are events, too; any event of a run says that it lives or has ended.
            "expect": ["prefect.flow-run.*"],
            "for_each": ["prefect.resource.id"],
            "threshold": 1,
            "within": SILENCE_S,
        },
        "actions": [
            {
                "type": "change-flow-run-state",
                "state": "CRASHED",
                "message": f"It has not sent a heartbeat for {SILENCE_S} s.",
            }
        ],
    }


def _holds(found: Any, meant: Any) -> bool:
    """Whether something has all that is expected; what the server has added is ignored."""
    if isinstance(meant, dict):
        return isinstance(found, dict) and all(_holds(found.get(key), meant[key]) for key in meant)
    if isinstance(meant, list) and isinstance(found, list):
        return len(found) == len(meant) and all(map(_holds, found, meant))
    return bool(found == meant)
