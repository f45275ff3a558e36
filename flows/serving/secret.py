"""The words that a server of this machine asks for: given, or made at its first start and kept for its user.

They stand in a file of the state folder that nobody else can read, so that commands of the same user report
to the server without being told, and others on the machine cannot.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Mapping
from pathlib import Path

from flows.serving.server_process import CLIENT_WORDS, SERVER_WORDS, ServerAddress
from flows.serving.state_file import find_server, state_folder
from tasks.storage.installation import InstallationError, writing_into

_SECRET = "secret"
_LINK = "link"


def words_of(address: ServerAddress, folder: Path, environment: Mapping[str, str] = os.environ) -> str:
    """The words a server asks for: those of the environment, else its own.

    Parameters
    ----------
    folder : of its state.

    Raises
    ------
    InstallationError
        If others could reach it and it was not told what they are to say.
    """
    given = environment.get(SERVER_WORDS)
    if given:
        return given
    if not address.is_loopback:
        raise InstallationError(
            f"With --host {address.host} others could start runs and read results without being asked.",
            f"Set {SERVER_WORDS}=user:password in the environment (and {CLIENT_WORDS} where runs are "
            "reported from), or stay with 127.0.0.1.",
        )
    kept = kept_words(folder)
    if kept is None:
        kept = f"aerocal:{secrets.token_urlsafe(32)}"
        _write_privately(folder / _SECRET, kept)
    return kept


def kept_words(folder: Path) -> str | None:
    """The words that a server of this folder has made; None: it has not.

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
                f"Others can read or have written the secret of the server, {file}.",
                "Remove it; the next start of aerocal serve makes another one.",
            )
        return stream.read(1_000).strip() or None


def keep_link(folder: Path, link: str) -> Path:
    """Write the link that makes a browser known, for this user only; where it stands."""
    _write_privately(folder / _LINK, link)
    return folder / _LINK


def bring_words_to(address: str, folder: Path | None = None) -> None:
    """Let this process bring the kept words to the server of this user, if that is who is asked.

    Parameters
    ----------
    address : of the API that is asked.
    """
    folder = state_folder() if folder is None else folder
    found = find_server(folder)
    if os.environ.get(CLIENT_WORDS) or found is None or not found.alive or found.server.url != address:
        return
    kept = kept_words(folder)
    if kept is not None:
        os.environ[CLIENT_WORDS] = kept


def _write_privately(file: Path, text: str) -> None:
    with writing_into(file.parent):
        temporary = file.with_suffix(".new")
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(f"{text}\n")
        temporary.replace(file)
