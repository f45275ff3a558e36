"""``aerocal serve`` and ``aerocal runner``: processes started, supervised, and ended in the right order.

Prefect starts a server and a runner with two commands and looks after neither. Here one command on one
machine does both: server and runner as children, all else (inbox, notices, production page) in this
process.
"""

from __future__ import annotations

import gc
import itertools
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from zoneinfo import ZoneInfo

from flows.server.api import Api
from flows.server.child import Child, Lifeline, Requests, Say, Supervised, requests_to_end
from flows.server.claims import DatabaseClaim, claimed, only_server_of, require_server_of
from flows.server.inbox import MANUAL
from flows.server.prefect_settings import prepare_prefect, require_server, server_address
from flows.server.server_process import (
    CLIENT_PASSWORD,
    ServerAddress,
    server_environment,
)
from flows.server.settings import Settings
from flows.server.state_file import (
    STATE_OPTION,
    RunningServer,
    bring_password_to,
    find_server,
    has_moved,
    keep_link,
    make_private,
    password_of,
    the_only_server,
    write_state,
)
from flows.server.watch import Repeated, Watch
from flows.serving.served_places import places_in, places_of, require_same
from tasks.errors import InputError
from tasks.files.installation import InstallationError, writing_into
from tasks.plain_text import visible
from tasks.production.notice import Links
from tasks.production.notice_addresses import ADDRESSES_VARIABLE, FILE_VARIABLE, configured_addresses
from tasks.production.outbox import Courier, Outbox
from tasks.production.records import Records
from tasks.production.run_record import OVERVIEW_VARIABLE
from tasks.store.run_lock import lock_if_free

#: The first start makes the database, on a slow machine.
_START_S = 240.0
#: Seconds between two looks into the outbox.
_NOTICES_S = 2.0
#: Seconds between two looks of a further runner whether its server answers.
_SILENCE_S = 20.0
#: Of the folder for temporary files, bytes: sockets of Python's fork server (`flows.serving.fork`) lie in it,
#: and their paths have 107 at most (unix(7)).
_LONGEST_TEMPORARY = 75
_READY = "Ready. Ctrl+C or SIGTERM stops it after the current runs have finished."


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
    records = _prepared(settings)
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


def _prepared(settings: Settings) -> Records:
    temporary = tempfile.gettempdir()
    if len(os.fsencode(temporary)) > _LONGEST_TEMPORARY:
        raise InstallationError(
            f"The path of the folder for temporary files has more than {_LONGEST_TEMPORARY} characters: "
            f"{visible(temporary)}.",
            "Set TMPDIR to a folder with a shorter path.",
        )
    # Other commands end soon (`flows.command`); this one runs for weeks.
    gc.set_threshold(50_000)
    make_private(settings.state)
    records = Records.at(settings.records)
    records.prepare()
    os.environ.setdefault("PREFECT_HOME", str(settings.state / "prefect"))
    prepare_prefect()
    return records


def _start_runner(
    settings: Settings, api: Api, lifeline: Lifeline, holds: Sequence[Lifeline] = (), name: str = "runner"
) -> Child:
    """Start a runner; it loads what it needs, and waits for the server."""
    environment = {
        **os.environ,
        **settings.variables(),
        "PREFECT_API_URL": api.url,
        "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
        **({CLIENT_PASSWORD: api.password} if api.password else {}),
    }
    log = settings.state / "logs" / f"{name}.log"
    return Child(
        "flows.serving.deployments", environment=environment, log=log, lifeline=lifeline, holds=holds
    )


def _places(settings: Settings) -> str:
    return "Projects may be located under: " + ", ".join(map(str, settings.roots.folders))


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
        return _start_runner(self.settings, self.api, self.of_runner, [self.of_server])

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
        self.say(_places(settings))
        self.say(_READY)

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
                _look_after([server, runner, self.claim], self.requests)
        except InstallationError:
            runner.drain(self.requests)
            raise
        return _stopped(runner, self.requests, self.say)


def _look_after(
    supervised: Sequence[Supervised | DatabaseClaim],
    requests: Requests,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    while not requests.come.wait(1.0) and not is_over():
        for one in supervised:
            one.look()


def _stopped(runner: Supervised, requests: Requests, say: Say) -> int:
    """Let the runner finish; returns the exit code."""
    say("Stopping after the current runs; a second request stops them now.")
    runner.drain(requests)
    return 0


def work_for(server: str | None, settings: Settings) -> tuple[str, Settings]:
    """The API address a further runner works for, and its settings, completed by those of that server.

    Parameters
    ----------
    server : value of ``--server``; None: the server of this user on this machine.

    Raises
    ------
    InputError
        If there is none, or one on another machine and no database that both reach, or the database is
        another one than that of the server.
    """
    found = find_server(settings.state)
    local = found if found is not None and found.alive else None
    url = server_address(server) or (None if local is None else local.url)
    if url is None:
        raise InputError("There is no server.", "Start aerocal serve, or name one with --server URL.")
    local = local if local is not None and local.url == url else None
    records = settings.database or (None if local is None else local.records)
    if records is None:
        raise InputError(
            f"The database of the server {url} is not known.",
            "Give the --database with which it was started; from another machine it must be PostgreSQL.",
        )
    of_server = records if local is None or local.records is None else local.records
    # PostgreSQL has many addresses (`require_server_of`).
    if records != of_server and not all("://" in one for one in (records, of_server)):
        raise InputError(
            f"The server {url} has its records in {of_server}, not in {records}.", "Omit --database."
        )
    overview = os.environ.get(OVERVIEW_VARIABLE) or (None if local is None else local.overview)
    page = ServerAddress("", 0, overview)
    return url, replace(settings, database=records, overview=page, registers=False)


def run_further_runner(server: str | None, settings: Settings, say: Say) -> int:
    """Carry out runs of a server until asked to end; returns the exit code.

    If it was not named, and comes back under another address, it is followed there.

    Parameters
    ----------
    server : as of `work_for`, whose errors are raised, too.

    Raises
    ------
    InputError
        If it has no registry, or another address of results, in contrast to the server.
    InstallationError
        If server or records cannot be reached, or the runner ends again and again.
    """
    with requests_to_end() as requests, ExitStack() as at_end:
        name = None
        while not requests.come.is_set():
            followed = None if server_address(server) else find_server(settings.state)
            url, completed = work_for(server, settings)
            bring_password_to(url, settings.state)
            require_server(url)
            require_server_of(Records.at(completed.records))
            _require_same_places(url, completed)
            _prepared(completed)
            name = name or at_end.enter_context(_own_name(settings.state))
            _work(url, completed, name, requests, say, followed)
            # It may be away again when the last run has ended.
            _look_after((), requests, lambda: _is_there(settings.state))
    return 0


def _require_same_places(url: str, settings: Settings) -> None:
    """Make sure that the server states no other places; it may not state any yet."""
    api = Api(url, os.environ.get(CLIENT_PASSWORD))
    deployment = api.get(f"/deployments/name/{settings.story}/{MANUAL}")
    places = None if deployment is None else places_in(deployment.get("parameter_openapi_schema"))
    if places is not None:
        require_same(places_of(settings), places)


def _is_there(state: Path) -> bool:
    found = find_server(state)
    return found is not None and found.alive and Api(found.url).is_well()


def _work(
    url: str, settings: Settings, name: str, requests: Requests, say: Say, followed: RunningServer | None
) -> None:
    """Carry out runs of a server until asked to end, or until it is to be followed to another place."""
    api, lifeline = Api(url, os.environ.get(CLIENT_PASSWORD)), Lifeline()
    trouble = "No runs are taken until the server answers"
    trouble += "" if followed else " (if it has another address now, restart this runner with --server)"
    silence = Repeated(lambda _is_over: api.get("/health"), _SILENCE_S, say, trouble, grace_s=0.0)
    runner = Supervised(
        "runner", partial(_start_runner, settings, api, lifeline, name=name), say, api.is_well
    )
    try:
        say(f"Working for {url}; log: {runner.child.log}")
        say(_places(settings))
        say(_READY)
        with silence:
            _look_after([runner], requests, lambda: has_moved(followed, settings.state))
        if not requests.come.is_set():
            say("The server has another address or database now; it is followed after the current runs.")
            runner.drain(requests)
        else:
            _stopped(runner, requests, say)
    finally:
        runner.end()
        lifeline.release()


@contextmanager
def _own_name(state: Path) -> Iterator[str]:
    """The first of the names runner-2, runner-3, … that no other runner of this folder has."""
    with writing_into(state, STATE_OPTION):
        for number in itertools.count(2):
            handle = os.open(state / f"runner-{number}.lock", os.O_RDWR | os.O_CREAT, 0o600)
            if lock_if_free(handle):
                break
            os.close(handle)
    try:
        yield f"runner-{number}"
    finally:
        os.close(handle)
