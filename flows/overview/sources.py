"""What the page is made from: records, server, registry, inbox; asked no more often than they change."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from typing import Generic, TypeVar

from flows.overview.server_queue import ServerView, server_view
from flows.serving.api import Api
from flows.serving.door import Door
from flows.serving.roots import Roots
from flows.serving.watch import InboxNews
from tasks.errors import AerocalError
from tasks.production.board import Board
from tasks.production.queue import queue_of_records
from tasks.production.records import Records
from tasks.registry.due import DueLimits
from tasks.registry.registry import Registry
from tasks.registry.watch import RegistryWatch, watch_of
from tasks.settings.registry import registry_address

T = TypeVar("T")
#: How long an answer of the server, and one of the registry, serves; s.
_SERVER_S, _REGISTRY_S = 5.0, 60.0


class Lasting(Generic[T]):
    """An answer that is asked for again only after a while; may be asked by several threads."""

    def __init__(self, ask: Callable[[], T], seconds: float) -> None:
        self._ask, self._seconds = ask, seconds
        self._lock = threading.Lock()
        self._answer: T | None = None
        self._until = -1.0

    def get(self) -> T:
        """The answer, at most so old."""
        with self._lock:
            if self._answer is None or time.monotonic() > self._until:
                self._answer = self._ask()
                self._until = time.monotonic() + self._seconds
            return self._answer


@dataclass(frozen=True)
class Calibrations:
    """What the registry says.

    Attributes
    ----------
    watch : its cameras; None: there is no registry, or it cannot be read.
    trouble : why not, a sentence; None: it was read.
    configured : whether the server was started with a registry.
    """

    watch: RegistryWatch | None
    trouble: str | None
    configured: bool


@dataclass(frozen=True)
class Sources:
    """Everything the page reads.

    Attributes
    ----------
    records : of production.
    dashboard : address of the server's own pages for browsers.
    roots : folders whose documents may be shown.
    api : of the server.
    door : who is let in.
    registry : address of the registry; None: there is none.
    inbox : what the last look into the inbox has found; None: there is no inbox.
    """

    records: Records
    dashboard: str
    roots: Roots
    api: Api
    door: Door
    registry: str | None
    inbox: Callable[[], InboxNews | None]
    board: Board = field(init=False)
    _server: Lasting[ServerView] = field(init=False)
    _calibrations: Lasting[Calibrations] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "board", Board(self.records))
        object.__setattr__(self, "_server", Lasting(self._ask_server, _SERVER_S))
        object.__setattr__(self, "_calibrations", Lasting(self._read_registry, _REGISTRY_S))

    def server(self) -> ServerView:
        """Whether the server answers, and its queue; else that of the records."""
        return self._server.get()

    def calibrations(self) -> Calibrations:
        """What the registry says."""
        return self._calibrations.get()

    def _ask_server(self) -> ServerView:
        found = server_view(self.api, datetime.now(UTC))
        if found.reachable:
            return found
        unfinished = self.records.runs(states=("Scheduled", "Running"))
        return ServerView(False, queue_of_records(unfinished), None)

    def _read_registry(self) -> Calibrations:
        if self.registry is None:
            return Calibrations(None, None, False)
        try:
            contents = Registry.at(registry_address(self.registry)).contents()
            return Calibrations(watch_of(contents, date.today(), DueLimits()), None, True)
        except AerocalError as error:
            return Calibrations(None, str(error), True)
