"""``aerocal serve``: server and runner as children, the inbox watched, an end in the right order."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from datetime import datetime

from flows.prefect_settings import prepare_prefect
from flows.serving.api import Api
from flows.serving.child import Child, Lifeline
from flows.serving.deliveries import MANUAL
from flows.serving.door import DOOR_VARIABLE
from flows.serving.notices import NoticeThread
from flows.serving.options import ServeOptions
from flows.serving.overview_process import OverviewProcess
from flows.serving.runner_process import RunnerPlace, runner_environment, start_runner
from flows.serving.secret import keep_link, words_of
from flows.serving.server_process import (
    SERVER_WORDS,
    is_well,
    server_environment,
    start_server,
    wait_until,
)
from flows.serving.state_file import RunningServer, make_private, the_only_server, write_state
from flows.serving.supervision import Requests, Say, Supervised, requests_to_end
from flows.serving.watch import Watch
from tasks.notification.addresses import ADDRESSES_VARIABLE, FILE_VARIABLE, configured_addresses
from tasks.notification.notice import Links
from tasks.production.records import Records
from tasks.storage.installation import InstallationError

#: The first start makes the database, on a slow machine.
_START_S = 240.0


def serve(options: ServeOptions, say: Say) -> int:
    """Run server and runner until asked to end; returns the exit code.

    Parameters
    ----------
    say : shows a sentence to the user.

    Raises
    ------
    InstallationError
        If the port is taken, another server of this user runs, or a child does not start, or ends again and
        again.
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
    links = Links(options.address.dashboard, options.overview.dashboard)
    notices = NoticeThread(records, addresses, options.notify_on, links, say)
    with requests_to_end() as requests, the_only_server(options.state):
        return _Serving(options, records, requests, say).carry_out(notices)


class _Serving:
    """One start of the server, from its first child to its last."""

    def __init__(self, options: ServeOptions, records: Records, requests: Requests, say: Say) -> None:
        self.options, self.records, self.requests, self.say = options, records, requests, say
        self.door = options.door(words_of(options.address, options.state))
        self.environment = server_environment(
            options.address, options.database, self.door, history_days=options.history_days
        )
        self.api = Api(options.address.api, self.door.words)
        self.place = RunnerPlace(
            options.roots,
            options.records,
            options.inbox,
            options.registry,
            options.results,
            options.state,
            options.overview.dashboard,
        )
        # The runner holds the server's, so that the server outlives it even if this process is killed.
        self.of_server, self.of_runner = Lifeline(), Lifeline()

    def carry_out(self, notices: NoticeThread) -> int:
        """Start server and runner, stay, and end them; the exit code."""
        with ExitStack() as at_end:
            at_end.callback(self.of_server.release)
            at_end.callback(self.of_runner.release)
            self.say("Starting the server; this takes up to half a minute.")
            server = Supervised("server", self._server, self.say)
            at_end.callback(self._server_has_ended, server)
            if not self._wait("server", self._is_well, server):
                return 0
            at_end.enter_context(notices)
            overview = self._overview()
            at_end.callback(overview.end)
            begun = time.time()
            runner = Supervised("runner", self._runner, self.say, self._is_well)
            at_end.callback(runner.end)
            if not self._wait("runner", lambda: self._polls(begun), runner):
                return 0
            self._ready()
            return self._stay(server, runner, overview)

    def _server(self) -> Child:
        log = self.options.state / "logs" / "server.log"
        return start_server(self.options.address, self.environment, log, self.of_server)

    def _runner(self) -> Child:
        return start_runner(self.api, self.options.runner, self.place, self.of_runner, [self.of_server])

    def _overview(self) -> OverviewProcess:
        options, log = self.options, self.options.state / "logs" / "overview.log"
        runner = runner_environment(self.api, self.place)
        environment = {
            **runner,
            SERVER_WORDS: self.door.words,
            DOOR_VARIABLE: self.door.as_variable(),
        }
        return OverviewProcess(options.overview, options.address.dashboard, environment, log, self.say)

    def _server_has_ended(self, server: Supervised) -> None:
        server.end()
        self.say("The server has ended.")

    def _is_well(self) -> bool:
        return is_well(self.options.address)

    def _wait(self, what: str, is_so: Callable[[], bool], service: Supervised) -> bool:
        return wait_until(what, is_so, service.child, self.requests.come.is_set, _START_S)

    def _polls(self, since: float) -> bool:
        """Whether our runner has registered its deployments since a time (s since 1970) and asks for runs."""
        try:
            deployment = self.api.get(f"/deployments/name/{self.options.runner.story}/{MANUAL}")
        except InstallationError:
            return False
        if deployment is None:
            return False
        # Another runner may ask for runs of deployments that an earlier start has registered.
        times = (deployment.get("updated"), deployment.get("last_polled"))
        return all(time and datetime.fromisoformat(time).timestamp() > since for time in times)

    def _ready(self) -> None:
        options = self.options
        where = RunningServer(options.address.api, os.getpid(), options.records, options.overview.dashboard)
        write_state(options.state, where)
        self.say(f"Dashboard: {options.address.dashboard}")
        self.say(f"Production page: {options.overview.dashboard}")
        self._tell_link()
        self.say("Projects may lie under: " + ", ".join(map(str, options.roots.folders)))
        self.say("Ready. The interrupt key or SIGTERM ends it when the runs that have begun are finished.")

    def _tell_link(self) -> None:
        """Where the link is that makes a browser known; itself only on a screen, for others may read logs."""
        link = f"{self.options.address.dashboard}{self.door.link}"
        file = keep_link(self.options.state, link)
        shown = link if sys.stdout.isatty() else f"it stands in {file}"
        self.say(f"A browser is let in by this link, to be opened once: {shown}")

    def _stay(self, server: Supervised, runner: Supervised, overview: OverviewProcess) -> int:
        """Look after children and inbox until a request to end has come; then let the runner finish."""
        watch = Watch(self.options, self.api, self.records, self.say)
        try:
            with watch:
                while not self.requests.come.wait(1.0):
                    server.look()
                    runner.look()
                    overview.look()
        except InstallationError:
            runner.drain(self.requests)
            raise
        self.say("Ending when the runs that have begun are finished; a second request ends them now.")
        runner.drain(self.requests)
        return 0
