"""``aerocal serve``: processes started, supervised, and ended in the right order.

Prefect starts a server and a runner with two commands and looks after neither. Here one command on one
machine does both: server and runner as children, all else (inbox, notices, production page) in this
process.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from datetime import datetime
from zoneinfo import ZoneInfo

from flows.server.api import Api
from flows.server.child import Child, Lifeline, Requests, Say, Supervised, requests_to_end
from flows.server.claims import DatabaseClaim, claimed, only_server_of
from flows.server.inbox import MANUAL
from flows.server.server_process import (
    server_environment,
)
from flows.server.settings import Settings
from flows.server.state_file import (
    RunningServer,
    keep_link,
    password_of,
    the_only_server,
    write_state,
)
from flows.server.watch import Repeated, Watch
from flows.serving.supervised_runner import (
    READY,
    look_after,
    prepared,
    started_runner,
    stated_folders,
    stopped,
)
from tasks.files.installation import InstallationError
from tasks.production.notice import Links
from tasks.production.notice_addresses import ADDRESSES_VARIABLE, FILE_VARIABLE, configured_addresses
from tasks.production.outbox import Courier, Outbox
from tasks.production.records import Records

#: The first start makes the database, on a slow machine.
_START_S = 240.0
#: Seconds between two looks into the outbox.
_NOTICES_S = 2.0


def serve(settings: Settings, say: Say) -> int:
    """Run server and runner until asked to end; returns the exit code.

    Parameters
    ----------
    say : shows a sentence to the user.

    Raises
    ------
    InstallationError
        If a port is taken, another server of this user runs, one has this database or inbox, or takes the
        database while it is restarted, the path for temporary files is too long, or a child does not start,
        or ends again and again.
    """
    settings.address.require_free()
    settings.overview.require_free("--overview-port")
    addresses = configured_addresses()
    records = prepared(settings)
    # Nobody but this process needs to know where notices go.
    for name in (ADDRESSES_VARIABLE, FILE_VARIABLE):
        os.environ.pop(name, None)
    links = Links(settings.address.dashboard, settings.overview.dashboard)
    courier = Courier(Outbox(records), addresses, settings.notify_on, links, say)
    trouble = "Notices cannot be delivered at the moment"
    notices = Repeated(courier.deliver, _NOTICES_S, say, trouble, grace_s=20.0, once_more=True)
    with (
        requests_to_end() as requests,
        the_only_server(settings.state),
        only_server_of(records, say) as claim,
        claimed(settings.inbox),
    ):
        return _Serving(settings, records, claim, requests, say).carry_out(notices)


class _Serving:
    """One start of the server, from its first child to its last."""

    def __init__(
        self, settings: Settings, records: Records, claim: DatabaseClaim, requests: Requests, say: Say
    ) -> None:
        self.settings, self.records, self.claim = settings, records, claim
        self.requests, self.say = requests, say
        self.door = settings.door(password_of(settings.address, settings.state))
        self.environment = server_environment(
            settings.address, settings.database, self.door, history_days=settings.history_days
        )
        self.api = Api(settings.address.api, self.door.password)
        # The runner holds the server's, so that the server outlives it even if this process is killed.
        self.of_server, self.of_runner = Lifeline(), Lifeline()

    def carry_out(self, notices: Repeated) -> int:
        """Start server and runner, supervise them, and end them; returns the exit code."""
        with ExitStack() as at_end:
            at_end.callback(self.of_server.release)
            at_end.callback(self.of_runner.release)
            self.say("Starting the server; this takes up to half a minute.")
            # All of them take seconds to load, and do so at the same time.
            begun = time.time()
            server = Supervised("server", self._server, self.say)
            at_end.callback(self._server_has_ended, server)
            at_end.enter_context(notices)
            runner = Supervised("runner", self._runner, self.say, self.api.is_well)
            at_end.callback(runner.end)
            watch = Watch(self.settings, self.api, self.records, self.say)
            at_end.enter_context(self._page(watch))
            if not self._wait(server, self.api.is_well):
                return 0
            if not self._wait(runner, lambda: self._polls(begun)):
                return 0
            self._ready()
            return self._stay(server, runner, watch)

    def _server(self) -> Child:
        log = self.settings.state / "logs" / "server.log"
        return Child(
            "flows.server.prefect_server", environment=self.environment, log=log, lifeline=self.of_server
        )

    def _runner(self) -> Child:
        return started_runner(self.settings, self.api, self.of_runner, [self.of_server])

    def _page(self, watch: Watch) -> AbstractContextManager[None]:
        from flows.overview.application import page_server
        from flows.overview.sources import Sources

        settings, dashboard = self.settings, self.settings.address.dashboard
        of_server = (dashboard, settings.roots, self.api, self.door, settings.registry)
        sources = Sources(self.records, *of_server, lambda: watch.inbox, ZoneInfo(settings.timezone))
        return page_server(sources, settings.overview.host, settings.overview.port)

    def _server_has_ended(self, server: Supervised) -> None:
        server.end()
        self.say("The server has stopped.")

    def _wait(self, service: Supervised, is_so: Callable[[], bool]) -> bool:
        """Wait for something a child is to bring about; False if asked to end before.

        Raises
        ------
        InstallationError
            If the child ends, or the time passes; with the last lines of its log.
        """
        child, until = service.child, time.monotonic() + _START_S
        while not is_so():
            if self.requests.come.is_set():
                return False
            if child.ended or time.monotonic() > until:
                reason = "ended" if child.ended else f"took longer than {_START_S:.0f} s"
                raise InstallationError(
                    f"The {service.name} {reason}.",
                    f"Its log is {child.log}; the last lines:\n{child.last_lines()}",
                )
            time.sleep(0.1)
        return True

    def _polls(self, since: float) -> bool:
        """Whether our runner has registered its deployments since a time (s since 1970) and asks for runs."""
        try:
            deployment = self.api.get(f"/deployments/name/{self.settings.story}/{MANUAL}")
        except InstallationError:
            return False
        if deployment is None:
            return False
        # Another runner may ask for runs of deployments that an earlier start has registered.
        times = (deployment.get("updated"), deployment.get("last_polled"))
        return all(time and datetime.fromisoformat(time).timestamp() > since for time in times)

    def _ready(self) -> None:
        settings = self.settings
        where = RunningServer(
            settings.address.api, os.getpid(), settings.records, settings.overview.dashboard
        )
        write_state(settings.state, where)
        self.say(f"Dashboard: {settings.address.dashboard}")
        self.say(f"Production page: {settings.overview.dashboard}")
        self._tell_link()
        self.say(stated_folders(settings))
        self.say(READY)

    def _tell_link(self) -> None:
        """Report where the access link is; the link itself only on a screen, because others may read logs."""
        link = f"{self.settings.address.dashboard}{self.door.link}"
        file = keep_link(self.settings.state, link)
        shown = link if sys.stdout.isatty() else f"it is stored in {file}"
        self.say(f"Open this link once to give a browser access: {shown}")

    def _stay(self, server: Supervised, runner: Supervised, watch: Watch) -> int:
        """Supervise children and inbox until asked to end; then let the runner finish."""
        try:
            with watch.watching():
                look_after([server, runner, self.claim], self.requests)
        except InstallationError:
            runner.drain(self.requests)
            raise
        return stopped(runner, self.requests, self.say)
