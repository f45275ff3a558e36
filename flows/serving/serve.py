"""``aerocal serve``: server and runner as children, the inbox watched, an end in the right order."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from types import FrameType

from flows.prefect_settings import prepare_prefect
from flows.serving.api import Api
from flows.serving.child import Child
from flows.serving.deliveries import MANUAL, schedule_deliveries
from flows.serving.inbox import INBOX_VARIABLE
from flows.serving.inbox_news import forget_inbox_news, keep_inbox_news
from flows.serving.notices import NoticeThread
from flows.serving.options import ServeOptions
from flows.serving.overview_process import OverviewProcess
from flows.serving.reconciliation import reconcile
from flows.serving.results import RESULTS_VARIABLE
from flows.serving.roots import ROOTS_VARIABLE, as_variable
from flows.serving.server_process import (
    CLIENT_WORDS,
    SERVER_WORDS,
    is_well,
    server_environment,
    start_server,
    wait_until,
)
from flows.serving.state_file import STATE_VARIABLE, RunningServer, make_private, the_only_server, write_state
from tasks.errors import AerocalError
from tasks.notification.addresses import ADDRESSES_VARIABLE, FILE_VARIABLE, configured_addresses
from tasks.notification.notice import Links
from tasks.production.records import Records
from tasks.production.variable import OVERVIEW_VARIABLE, RECORDS_VARIABLE
from tasks.settings.registry import REGISTRY_VARIABLE
from tasks.storage.installation import InstallationError

#: The first start makes the database, on a slow machine.
_START_S = 240.0
#: What server and runner get to end once nothing runs any more.
_END_S = 30.0

Say = Callable[[str], None]


class _Requests:
    """How often the process was asked to end (SIGTERM, interrupt key)."""

    def __init__(self) -> None:
        self.number = 0
        self.come = threading.Event()

    def note(self, _signal: int, _frame: FrameType | None) -> None:
        """A signal has come."""
        self.number += 1
        self.come.set()


@contextmanager
def _noted() -> Iterator[_Requests]:
    """Note requests to end while the context lasts, in place of ending at once."""
    requests = _Requests()
    before = {which: signal.signal(which, requests.note) for which in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield requests
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)


def serve(options: ServeOptions, say: Say) -> int:
    """Run server and runner until asked to end; returns the exit code.

    Parameters
    ----------
    say : shows a sentence to the user.

    Raises
    ------
    InstallationError
        If the port is taken, another server of this user runs, or a child does not start.
    """
    options.runner.require_valid()
    options.address.require_free()
    options.overview.require_free("--overview-port")
    addresses = configured_addresses()
    make_private(options.state)
    records = Records.at(options.records)
    records.prepare()
    os.environ.setdefault("PREFECT_HOME", str(options.state / "prefect"))
    prepare_prefect()
    # Nobody but this process needs to know where notices go.
    for name in (ADDRESSES_VARIABLE, FILE_VARIABLE):
        os.environ.pop(name, None)
    environment = server_environment(options.address, options.database, history_days=options.history_days)
    links = Links(options.address.dashboard, options.overview.dashboard)
    notices = NoticeThread(records, addresses, options.notify_on, links, say)
    with _noted() as requests, the_only_server(options.state):
        server = start_server(options.address, environment, options.state / "logs" / "server.log")
        try:
            say("Starting the server; this takes up to half a minute.")
            if not wait_until(
                "server", lambda: is_well(options.address), server, requests.come.is_set, _START_S
            ):
                return 0
            with notices:
                return _with_server(options, records, server, requests, say)
        finally:
            server.end_group(_END_S)
            say("The server has ended.")


def _with_server(
    options: ServeOptions, records: Records, server: Child, requests: _Requests, say: Say
) -> int:
    """Start the runner beside a server that is well, and stay until the end."""
    words = os.environ.get(CLIENT_WORDS) or os.environ.get(SERVER_WORDS)
    environment = {
        **os.environ,
        "PREFECT_API_URL": options.address.api,
        "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
        ROOTS_VARIABLE: as_variable(options.roots),
        RECORDS_VARIABLE: options.records,
        STATE_VARIABLE: str(options.state),
        **({CLIENT_WORDS: words} if words else {}),
        **({INBOX_VARIABLE: str(options.inbox.resolve())} if options.inbox is not None else {}),
        **({REGISTRY_VARIABLE: options.registry} if options.registry is not None else {}),
        RESULTS_VARIABLE: "" if options.results is None else str(options.results),
    }
    logs, dashboard = options.state / "logs", options.address.dashboard
    overview = OverviewProcess(options.overview, dashboard, environment, logs / "overview.log", say)
    try:
        return _with_runner(options, records, server, overview, environment, requests, say)
    finally:
        overview.end()


def _with_runner(
    options: ServeOptions,
    records: Records,
    server: Child,
    overview: OverviewProcess,
    environment: Mapping[str, str],
    requests: _Requests,
    say: Say,
) -> int:
    """Start the runner beside server and production page, and stay until the end."""
    api = Api(options.address.api, environment.get(CLIENT_WORDS))
    runner = Child(
        "flows.serving.runner",
        options.runner.as_text(),
        environment={**environment, OVERVIEW_VARIABLE: options.overview.dashboard},
        log=options.state / "logs" / "runner.log",
        holds=server.lifeline,
    )
    try:
        begun = time.time()
        if not wait_until(
            "runner", lambda: _polls(api, options.runner.story, begun), runner, requests.come.is_set, _START_S
        ):
            return 0
        where = RunningServer(options.address.api, os.getpid(), options.records, options.overview.dashboard)
        write_state(options.state, where)
        say(f"Dashboard: {options.address.dashboard}")
        say(f"Production page: {options.overview.dashboard}")
        say("Projects may lie under: " + ", ".join(map(str, options.roots.folders)))
        say("Ready. The interrupt key or SIGTERM ends it when the runs that have begun are finished.")
        return _stay(_Watch(options, api, records, overview, say), server, runner, requests)
    finally:
        runner.end_group(_END_S)


def _polls(api: Api, story: str, since: float) -> bool:
    """Whether the runner has registered its deployments and, after a time (s since 1970), asks for runs."""
    try:
        deployment = api.get(f"/deployments/name/{story}/{MANUAL}")
    except InstallationError:
        return False
    polled = None if deployment is None else deployment.get("last_polled")
    return polled is not None and datetime.fromisoformat(polled).timestamp() > since


class _Watch:
    """What is looked after while server and runner run.

    The production page, the inbox, and runs that could not note their end.
    """

    def __init__(
        self, options: ServeOptions, api: Api, records: Records, overview: OverviewProcess, say: Say
    ) -> None:
        self.options, self.api, self.records, self.say = options, api, records, say
        self.overview = overview
        self.verified: set[str] = set()
        self.said: set[str] = set()
        self.next = time.monotonic()

    def look(self) -> None:
        """Look if it is time; say what cannot be done, once."""
        self.overview.look()
        if time.monotonic() < self.next:
            return
        try:
            reconcile(self.api, self.records)
            news = self._look_into_inbox()
        except AerocalError as error:
            news = [str(error)]
        for sentence in news:
            if sentence not in self.said:
                self.say(sentence)
        self.said = set(news)
        self.next = time.monotonic() + self.options.watch_s

    def _look_into_inbox(self) -> list[str]:
        """Start what is complete; sentences on what cannot be started."""
        if self.options.inbox is None:
            forget_inbox_news(self.options.state)
            return []
        roots, story = self.options.roots, self.options.runner.story
        inbox = self.options.inbox
        found = schedule_deliveries(self.api, self.records, inbox, roots, story, self.verified)
        for name in found.begun:
            self.say(f"Delivery {name}: a run is scheduled.")
        keep_inbox_news(self.options.state, found.waiting, found.refused)
        return list(found.refused)


def _stay(watch: _Watch, server: Child, runner: Child, requests: _Requests) -> int:
    """Watch children and inbox until a request to end has come; then let the runner finish."""
    while not requests.come.wait(1.0):
        for name, child in (("server", server), ("runner", runner)):
            if child.ended:
                raise InstallationError(
                    f"The {name} has ended by itself.",
                    f"Start again; runs go on where they stood. Its log is {child.log}; the last lines:\n"
                    f"{child.last_lines()}",
                )
            child.begin_log_anew()
        watch.look()
    watch.say("Ending when the runs that have begun are finished; a second request ends them now.")
    runner.ask_to_end()
    while requests.number < 2 and not runner.wait(0.5):
        pass
    return 0
