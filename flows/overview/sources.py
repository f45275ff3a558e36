"""The sources of the production page: records, server, registry, inbox."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar
from zoneinfo import ZoneInfo

from flows.server.api import Api
from flows.server.door import Door
from flows.server.inbox import SEARCH, Scheduled
from flows.server.roots import Roots
from tasks.errors import AerocalError
from tasks.files.installation import InstallationError
from tasks.production.board import Board
from tasks.production.records import Records
from tasks.production.run_record import RunRecord, project_name
from tasks.settings.registry import registry_address

if TYPE_CHECKING:
    from tasks.registry.watch import RegistryWatch


@dataclass(frozen=True)
class QueuedRun:
    """A waiting or active run.

    Attributes
    ----------
    run : its id.
    name : project and story, or what the server calls it.
    state : of the server (``Scheduled``, ``Late``, ``Pending``, ``Running``, ``AwaitingRetry`` …).
    due : time from which it may begin, UTC.
    begun : UTC; None: not yet.
    """

    run: str
    name: str
    state: str
    due: datetime
    begun: datetime | None

    def waiting_since(self, now: datetime) -> datetime | None:
        """Time since which it could have started; None: it has started, or is not due yet."""
        return None if self.begun is not None or self.due > now else self.due


def _of_record(run: RunRecord) -> QueuedRun:
    # One that waits for another attempt has begun before.
    begun = run.begun if run.state == "Running" else None
    return QueuedRun(run.id, f"{run.project} · {run.story}", run.state, run.scheduled, begun)


def _in_order(queue: Iterable[QueuedRun]) -> tuple[QueuedRun, ...]:
    """Active runs first, then waiting ones in the order of their turn."""
    return tuple(sorted(queue, key=lambda one: (one.begun is None, one.begun or one.due, one.run)))


_OPEN = ("SCHEDULED", "PENDING", "RUNNING", "PAUSED", "CANCELLING")
#: As many as the server hands out at once.
_MOST = 200


@dataclass(frozen=True)
class ServerView:
    """The state of the server.

    Attributes
    ----------
    reachable : whether it answers.
    queue : active and due runs, in their order.
    next : the next scheduled run; None: there is none.
    more : active and due runs beyond those of the queue.
    search : time from which the next search of the inbox may begin, UTC; None: none is known.
    """

    reachable: bool
    queue: tuple[QueuedRun, ...]
    next: QueuedRun | None
    more: int = 0
    search: datetime | None = None


def server_view(api: Api, now: datetime) -> ServerView:
    """Ask the server."""
    wanted: dict[str, Any] = {"state": {"type": {"any_": list(_OPEN)}}}
    asked = {"flow_runs": wanted, "sort": "EXPECTED_START_TIME_ASC", "limit": _MOST}
    due = {"flow_runs": {**wanted, "expected_start_time": {"before_": now.isoformat()}}}
    # A server that hangs would be waited for as long as one that is busy.
    if not api.is_well():
        return ServerView(False, (), None)
    try:
        flows = {flow["id"]: flow["name"] for flow in api.post("/flows/filter", {})}
        found = [_queued(run, flows) for run in api.post("/flow_runs/filter", asked)]
        count = api.post("/flow_runs/count", due) if len(found) == _MOST else 0
    except InstallationError:
        return ServerView(False, (), None)
    ahead = [run for run in found if run.begun is None and run.due > now]
    queue = _in_order(run for run in found if run not in ahead)
    first = min(ahead, key=lambda run: run.due, default=None)
    search = min((run.due for run in found if run.name == SEARCH and run.begun is None), default=None)
    return ServerView(True, queue, first, max(count - len(queue), 0), search)


def _queued(run: Mapping[str, Any], flows: Mapping[str, str]) -> QueuedRun:
    begun = run.get("start_time") if run["state_type"] != "SCHEDULED" else None
    due = run.get("next_scheduled_start_time") or run.get("expected_start_time") or begun or run["created"]
    return QueuedRun(
        str(run["id"]),
        _name(run, flows),
        str(run["state_name"]),
        datetime.fromisoformat(due),
        None if begun is None else datetime.fromisoformat(begun),
    )


def _name(run: Mapping[str, Any], flows: Mapping[str, str]) -> str:
    """Project and story; Prefect names a run of a deployment by chance until it begins."""
    flow = flows.get(run["flow_id"])
    if flow is None or run["deployment_id"] is None:
        return str(run["name"])
    project = run["parameters"].get("project")
    return flow if project is None else f"{project_name(Path(str(project)))} · {flow}"


T = TypeVar("T")
#: How long an answer of the server, and one of the registry, serves; s.
_SERVER_S, _REGISTRY_S = 5.0, 60.0


class Lasting(Generic[T]):
    """A cached answer, requested again only after a while; safe for several threads."""

    def __init__(self, ask: Callable[[], T], seconds: float) -> None:
        self._ask, self._seconds = ask, seconds
        self._lock = threading.Lock()
        self._answer: T | None = None
        self._until = -1.0

    def __call__(self) -> T:
        """The answer, no older than allowed."""
        with self._lock:
            if self._answer is None or time.monotonic() > self._until:
                self._answer = self._ask()
                self._until = time.monotonic() + self._seconds
            return self._answer


@dataclass(frozen=True)
class Calibrations:
    """The calibrations of the registry.

    Attributes
    ----------
    watch : its cameras; None: there is no registry, or it cannot be read.
    trouble : why not, a sentence; None: it was read.
    """

    watch: RegistryWatch | None
    trouble: str | None


@dataclass(frozen=True)
class Sources:
    """Everything the page reads.

    Attributes
    ----------
    records : of production.
    dashboard : address of the server's own pages for browsers.
    roots : folders whose documents may be shown.
    api : of the server.
    door : the rules of access.
    registry : address of the registry; None: there is none.
    inbox : what the last search of the inbox found; None: there is no inbox.
    zone : the time zone of the times that are shown.
    """

    records: Records
    dashboard: str
    roots: Roots
    api: Api
    door: Door
    registry: str | None
    inbox: Callable[[], Scheduled | None]
    zone: ZoneInfo

    def now(self) -> datetime:
        """The present time, in the zone of the page."""
        return datetime.now(self.zone)

    @cached_property
    def board(self) -> Board:
        """The board of these records."""
        return Board(self.records)

    @cached_property
    def server(self) -> Lasting[ServerView]:
        """Whether the server answers, and its queue; without an answer, that of the records."""
        return Lasting(self._ask_server, _SERVER_S)

    @cached_property
    def calibrations(self) -> Lasting[Calibrations]:
        """The calibrations of the registry."""
        return Lasting(self._read_registry, _REGISTRY_S)

    def _ask_server(self) -> ServerView:
        found = server_view(self.api, datetime.now(UTC))
        if found.reachable:
            return found
        # These lack waiting runs that were started in the dashboard.
        unfinished = self.records.runs(states=("Scheduled", "Running"))
        return ServerView(False, _in_order(map(_of_record, unfinished)), None)

    def _read_registry(self) -> Calibrations:
        if self.registry is None:
            return Calibrations(None, None)
        # Every start of the server would load them otherwise, and pandas and scipy with them.
        from tasks.registry.due import DueLimits
        from tasks.registry.registry import Registry
        from tasks.registry.watch import watch_of

        try:
            contents = Registry.at(registry_address(self.registry)).contents()
            return Calibrations(watch_of(contents, self.now().date(), DueLimits()), None)
        except AerocalError as error:
            return Calibrations(None, str(error))
