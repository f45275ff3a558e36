"""``aerocal runner``: a further runner beside that of ``aerocal serve``, on the same machine or another."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from flows.prefect_settings import prepare_prefect, require_server, server_address
from flows.serving.api import Api
from flows.serving.child import Child, Lifeline
from flows.serving.options import RunnerOptions
from flows.serving.runner_process import RunnerPlace, start_runner
from flows.serving.secret import bring_words_to
from flows.serving.server_process import CLIENT_WORDS
from flows.serving.state_file import find_server, make_private
from flows.serving.supervision import Requests, Say, Supervised, requests_to_end
from tasks.errors import InputError
from tasks.production.records import Records
from tasks.production.variable import OVERVIEW_VARIABLE
from tasks.storage.installation import InstallationError, writing_into


@dataclass(frozen=True)
class Serving:
    """The ``aerocal serve`` that a further runner works for.

    Attributes
    ----------
    url : address of its API.
    records : address of the records of production, without a password.
    overview : address of the production page; None: it is not known.
    """

    url: str
    records: str
    overview: str | None


def serving(server: str | None, database: str | None, state: Path) -> Serving:
    """What a further runner works for: as given, else the server of this user on this machine.

    Parameters
    ----------
    server, database : values of ``--server`` and ``--database``.

    Raises
    ------
    InputError
        If there is none, or one on another machine and no database that both reach.
    """
    found = find_server(state)
    local = found.server if found is not None and found.alive else None
    url = server_address(server) or (None if local is None else local.url)
    if url is None:
        raise InputError(
            "There is no server to work for.", "Start aerocal serve, or name one with --server URL."
        )
    local = local if local is not None and local.url == url else None
    records = database or (None if local is None else local.records)
    if records is None:
        raise InputError(
            f"It is not known where the server {url} keeps the records of its runs.",
            "Give the --database it was started with; from another machine it must be PostgreSQL.",
        )
    overview = os.environ.get(OVERVIEW_VARIABLE) or (None if local is None else local.overview)
    return Serving(url, records, overview)


def run_further_runner(
    work: Serving, options: RunnerOptions, place: RunnerPlace, state: Path, say: Say
) -> int:
    """Carry out runs until asked to end; returns the exit code.

    Raises
    ------
    InstallationError
        If server or records cannot be reached, or the runner ends again and again.
    """
    make_private(state)
    Records.at(work.records).prepare()
    bring_words_to(work.url, state)
    require_server(work.url)
    os.environ.setdefault("PREFECT_HOME", str(state / "prefect"))
    prepare_prefect()
    api = Api(work.url, os.environ.get(CLIENT_WORDS))
    lifeline = Lifeline()
    with requests_to_end() as requests, _own_name(state) as name:

        def start() -> Child:
            return start_runner(api, options, place, lifeline, name=name)

        runner = Supervised("runner", start, say, lambda: _answers(work.url))
        try:
            say(f"Working for {work.url}; log: {runner.child.log}")
            say("Ready. The interrupt key or SIGTERM ends it when the runs that have begun are finished.")
            _stay(runner, requests)
            say("Ending when the runs that have begun are finished; a second request ends them now.")
            runner.drain(requests)
        finally:
            runner.end()
            lifeline.release()
    return 0


def _stay(runner: Supervised, requests: Requests) -> None:
    while not requests.come.wait(1.0):
        runner.look()


def _answers(url: str) -> bool:
    try:
        require_server(url)
    except InstallationError:
        return False
    return True


@contextmanager
def _own_name(state: Path) -> Iterator[str]:
    """The first of the names runner-2, runner-3, … that no other runner of this folder has."""
    with writing_into(state):
        state.mkdir(mode=0o700, parents=True, exist_ok=True)
        number, handle = 2, -1
        while handle < 0:
            handle = _lock(state / f"runner-{number}.lock")
            number += 1
    try:
        yield f"runner-{number - 1}"
    finally:
        os.close(handle)


def _lock(file: Path) -> int:
    """A handle that holds the lock of a file; -1 if somebody else does."""
    handle = os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return -1
    return handle
