"""The queue of the server, asked of its API."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from flows.serving.api import Api
from tasks.production.queue import QueuedRun, in_order, times_from
from tasks.storage.installation import InstallationError

_OPEN = ("SCHEDULED", "PENDING", "RUNNING", "PAUSED", "CANCELLING")
#: As many as the server hands out at once.
_MOST = 200


@dataclass(frozen=True)
class ServerView:
    """What the server says.

    Attributes
    ----------
    reachable : whether it answers.
    queue : runs in work and runs whose time has come, in their order.
    next : the scheduled run whose time comes next; None: there is none.
    """

    reachable: bool
    queue: tuple[QueuedRun, ...]
    next: QueuedRun | None


def server_view(api: Api, now: datetime) -> ServerView:
    """Ask the server."""
    asked = {
        "flow_runs": {"state": {"type": {"any_": list(_OPEN)}}},
        "sort": "EXPECTED_START_TIME_ASC",
        "limit": _MOST,
    }
    try:
        found = [_queued(run) for run in api.post("/flow_runs/filter", asked)]
    except InstallationError:
        return ServerView(False, (), None)
    ahead = [run for run in found if run.begun is None and run.due > now]
    return ServerView(
        True,
        in_order([run for run in found if run not in ahead]),
        min(ahead, key=lambda run: run.due, default=None),
    )


def _queued(run: Mapping[str, Any]) -> QueuedRun:
    begun = times_from(run.get("start_time")) if run["state_type"] != "SCHEDULED" else None
    due = times_from(run.get("next_scheduled_start_time") or run.get("expected_start_time")) or begun
    return QueuedRun(
        str(run["id"]),
        str(run["name"]),
        str(run["state_name"]),
        due or times_from(run["created"]),  # type: ignore[arg-type]
        begun,
    )
