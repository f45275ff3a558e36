"""Errors of a database as one sentence with a remedy, never with a password."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from sqlalchemy.exc import DBAPIError, IntegrityError

from tasks.database.address import DatabaseAddress
from tasks.errors import AerocalError, InputError
from tasks.files.installation import InstallationError

_BUSY = (
    "The {what} {address} is locked by another process that does not finish.",
    "Wait for it, or stop it; nothing was changed.",
)
_REACH = "Start it, or correct {named_by}."
# SQLSTATE → what, remedy.
_SERVER: Mapping[str, tuple[str, str]] = {
    "28P01": ("The database {address} refuses this user or password.", "Give the password in PGPASSWORD."),
    "28000": ("The database {address} refuses this user.", "Ask its administrator for access."),
    "3D000": ("There is no database {address}.", "Create it, or correct {named_by}."),
    "42501": ("This user may not write to {address}.", "Ask its administrator for access."),
    "55P03": _BUSY,
    "25006": ("The database {address} may only be read.", "Name the server that accepts changes."),
}
# Beginning of SQLite's message → what, remedy.
_FILE: Mapping[str, tuple[str, str]] = {
    "database is locked": _BUSY,
    "unable to open database file": (
        "The {what} {address} cannot be opened.",
        "Check its folder and permissions, or name another location ({named_by}).",
    ),
    "attempt to write a readonly database": (
        "The {what} {address} cannot be written.",
        "Change the permissions of the file and its folder.",
    ),
    "database or disk is full": ("There is no space left on the disk of {address}.", "Free some space."),
}
# Undefined table, undefined column.
_MISSING = ("42P01", "42703", "no such table", "no such column")
_NO_DATABASE = ("file is not a database", "database disk image is malformed")


@contextmanager
def in_words(address: DatabaseAddress) -> Iterator[None]:
    """Turn errors of a database into errors of ours; a broken constraint passes as it is.

    Raises
    ------
    InputError
        If the file is no SQLite database, or its tables are no longer those of a registry.
    InstallationError
        If the database cannot be reached, opened or written.
    """
    try:
        yield
    except IntegrityError:
        raise
    except DBAPIError as error:
        raise _explained(error, address) from None
    except OSError as error:
        if address.is_file:
            raise
        # Certificates and broken connections; the driver lets them pass as they are.
        reason = error.strerror or type(error).__name__
        what = f"The database {address} cannot be reached ({reason})."
        raise InstallationError(what, _filled(_REACH, address)) from None


def _explained(error: DBAPIError, address: DatabaseAddress) -> AerocalError:
    reason = error.orig
    if isinstance(reason, sqlite3.Error):
        return _of_file(str(reason), address)
    fields = reason.args[0] if reason is not None and reason.args else None
    if not isinstance(fields, Mapping):
        return _in_the_way(("The database {address} cannot be reached.", _REACH), address)
    state, message = str(fields.get("C", "")), str(fields.get("M", ""))
    if state in _MISSING:
        return _without_table(message, address)
    if state in _SERVER:
        return _in_the_way(_SERVER[state], address)
    return InstallationError(f"The database {address} refuses: {message}.", _filled(_REACH, address))


def _of_file(message: str, address: DatabaseAddress) -> AerocalError:
    if message.startswith(_NO_DATABASE):
        remedy = "Restore it from a backup, or name another file ({named_by})."
        what = "This is not a SQLite database, or it is damaged."
        return InputError(what, _filled(remedy, address), file=address.file)
    if message.startswith(_MISSING):
        return _without_table(message, address)
    for beginning, sentences in _FILE.items():
        if message.startswith(beginning):
            return _in_the_way(sentences, address)
    return InstallationError(
        f"The {address.holding.what} {address} cannot be used ({message}).", "Check the file and its disk."
    )


def _without_table(message: str, address: DatabaseAddress) -> InputError:
    return InputError(
        f"The {address.holding.what} {address} was edited: {message}.",
        "Restore it from a backup; nothing was changed.",
    )


def _in_the_way(sentences: tuple[str, str], address: DatabaseAddress) -> InstallationError:
    what, remedy = sentences
    return InstallationError(_filled(what, address), _filled(remedy, address))


def _filled(sentence: str, address: DatabaseAddress) -> str:
    holding = address.holding
    return sentence.format(address=address, what=holding.what, named_by=holding.named_by)
