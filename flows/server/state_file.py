"""Address and password of the running server: files in the state folder, for this user only.

Prefect knows a server by the address it is told; here later commands of the same user find it by
themselves. The lock is the operating system's, so it ends with the process that holds it, however that
ends; a process number that has been given to another program deceives nobody. The password is given, or made
at the first start; commands of the same user report to the server without being told, and others on the
machine cannot.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

from flows.server.server_process import CLIENT_PASSWORD, SERVER_PASSWORD, ServerAddress
from tasks.files.installation import InstallationError, writing_into
from tasks.files.state_folder import state_folder
from tasks.store.run_lock import lock_if_free

STATE_OPTION = "--state"
#: A command that looks whether a server lives holds its lock for an instant, and not for so long, s.
_LOOK_S = 0.5


@dataclass(frozen=True)
class RunningServer:
    """Content of the state file.

    Attributes
    ----------
    url : API address, with ``/api``.
    pid : number of the process of ``aerocal serve``.
    records : where the records of production are, without a password; None: an older server.
    overview : address of the production page for browsers; None: an older server.
    alive : whether the process that wrote it is alive.
    """

    url: str
    pid: int
    records: str | None = None
    overview: str | None = None
    alive: Annotated[bool, Field(exclude=True)] = True


_SERVER = TypeAdapter(RunningServer)


def find_server(folder: Path | None = None) -> RunningServer | None:
    """The server that the state file names; None if the file is missing or cannot be read."""
    folder = state_folder() if folder is None else folder
    try:
        server = _SERVER.validate_json((folder / "serve.json").read_bytes())
    except (OSError, ValueError):
        return None
    return replace(server, alive=_is_locked(folder / "serve.lock"))


def has_moved(server: RunningServer | None, folder: Path) -> bool:
    """Whether this server runs at another address or with other records now; None has not."""
    found = find_server(folder)
    return (
        server is not None
        and found is not None
        and found.alive
        and (found.url, found.records) != (server.url, server.records)
    )


def _is_locked(file: Path) -> bool:
    try:
        handle = os.open(file, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def make_private(folder: Path) -> None:
    """Create the state folder for this user only; an existing one is left unchanged.

    Raises
    ------
    InstallationError
        If it cannot be made.
    """
    with writing_into(folder, STATE_OPTION):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)


@contextmanager
def the_only_server(folder: Path) -> Iterator[None]:
    """Be the server of this folder while the context lasts; its state file is removed afterwards.

    Raises
    ------
    InstallationError
        If another one lives, or the folder cannot be written.
    """
    make_private(folder)
    with writing_into(folder, STATE_OPTION):
        handle = os.open(folder / "serve.lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        _hold(handle, folder)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                (folder / "serve.json").unlink()
    finally:
        os.close(handle)


def _hold(handle: int, folder: Path) -> None:
    until = time.monotonic() + _LOOK_S
    while not lock_if_free(handle):
        if time.monotonic() < until:
            time.sleep(0.02)
            continue
        found = find_server(folder)
        where = f" at {found.url} (process {found.pid})" if found is not None else ""
        raise InstallationError(
            f"A server of yours is already running{where}.",
            "Use it, or stop it first; a second one needs its own folder (--state).",
        )


def write_state(folder: Path, server: RunningServer) -> None:
    """Write the state file: readable for this user only, never half-written."""
    _write_privately(folder / "serve.json", _SERVER.dump_json(server).decode())


_SECRET = "secret"
_LINK = "link"


def password_of(address: ServerAddress, folder: Path, environment: Mapping[str, str] = os.environ) -> str:
    """The password a server requires: that of the environment, otherwise its own.

    Parameters
    ----------
    folder : of its state.

    Raises
    ------
    InstallationError
        If others could reach it and it was not told what they are to say.
    """
    given = environment.get(SERVER_PASSWORD)
    if given:
        return given
    if not address.is_loopback:
        raise InstallationError(
            f"With --host {address.host}, others could start runs and read results without a password.",
            f"Set {SERVER_PASSWORD}=user:password in the environment (and {CLIENT_PASSWORD} on machines "
            "that report runs), or use 127.0.0.1.",
        )
    kept = kept_password(folder)
    if kept is None:
        kept = f"aerocal:{secrets.token_urlsafe(32)}"
        _write_privately(folder / _SECRET, kept)
    return kept


def kept_password(folder: Path) -> str | None:
    """The password that a server of this folder has made; None if it has made none.

    Raises
    ------
    InstallationError
        If others can read them, or wrote them.
    """
    file = folder / _SECRET
    try:
        handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InstallationError(
            f"{file} cannot be read ({error.strerror}).", "Remove it, and start again."
        ) from error
    with os.fdopen(handle, encoding="utf-8") as stream:
        about = os.fstat(handle)
        if about.st_uid != os.geteuid() or about.st_mode & 0o077:
            raise InstallationError(
                f"The secret of the server, {file}, can be read or was written by others.",
                "Remove it; aerocal serve creates a new one at the next start.",
            )
        return stream.read(1_000).strip() or None


def keep_link(folder: Path, link: str) -> Path:
    """Write the link that admits a browser, readable for this user only; returns its path."""
    _write_privately(folder / _LINK, link)
    return folder / _LINK


def bring_password_to(address: str, folder: Path | None = None) -> None:
    """Let this process use the kept password for requests to the server of this user.

    Parameters
    ----------
    address : of the API that is asked.
    """
    folder = state_folder() if folder is None else folder
    found = find_server(folder)
    if os.environ.get(CLIENT_PASSWORD) or found is None or not found.alive or found.url != address:
        return
    kept = kept_password(folder)
    if kept is not None:
        os.environ[CLIENT_PASSWORD] = kept


def _write_privately(file: Path, text: str) -> None:
    with writing_into(file.parent, STATE_OPTION):
        temporary = file.with_suffix(".new")
        temporary.unlink(missing_ok=True)
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(f"{text}\n")
        temporary.replace(file)
