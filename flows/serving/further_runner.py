"""``aerocal runner``: a further runner for a server that runs already, here or on another machine."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from flows.server.api import Api
from flows.server.child import Lifeline, Requests, Say, Supervised, requests_to_end
from flows.server.claims import require_server_of
from flows.server.inbox import MANUAL
from flows.server.prefect_settings import require_server, server_address
from flows.server.server_process import CLIENT_PASSWORD, ServerAddress
from flows.server.settings import Settings
from flows.server.state_file import STATE_OPTION, RunningServer, bring_password_to, find_server, has_moved
from flows.server.watch import Repeated
from flows.serving.served_places import places_in, places_of, require_same
from flows.serving.supervised_runner import (
    READY,
    look_after,
    prepared,
    started_runner,
    stated_folders,
    stopped,
)
from tasks.errors import InputError
from tasks.files.installation import writing_into
from tasks.production.records import Records
from tasks.production.run_record import OVERVIEW_VARIABLE
from tasks.store.run_lock import lock_if_free

#: Seconds between two looks of a further runner whether its server answers.
_SILENCE_S = 20.0


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
            prepared(completed)
            name = name or at_end.enter_context(_own_name(settings.state))
            _work(url, completed, name, requests, say, followed)
            # It may be away again when the last run has ended.
            look_after((), requests, lambda: _is_there(settings.state))
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
        "runner", partial(started_runner, settings, api, lifeline, name=name), say, api.is_well
    )
    try:
        say(f"Working for {url}; log: {runner.child.log}")
        say(stated_folders(settings))
        say(READY)
        with silence:
            look_after([runner], requests, lambda: has_moved(followed, settings.state))
        if not requests.come.is_set():
            say("The server has another address or database now; it is followed after the current runs.")
            runner.drain(requests)
        else:
            stopped(runner, requests, say)
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
