"""A database and an inbox belong to one server.

A second one would remove the schedules of the first, and with records of its own, run every delivery again.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError

from flows.server.child import Say
from flows.server.watch import Repeated
from tasks.database.errors import in_words
from tasks.files.installation import InstallationError
from tasks.files.machine import machine
from tasks.production.records import Records
from tasks.store.run_lock import lock_if_free

#: How long a server that is ending is waited for, s.
_LOOK_S = 2.0
#: In the inbox.
_LOCK_FILE = ".aerocal.lock"
#: Seconds between two looks whether the database still knows the lock.
_EVERY_S = 5.0
#: Any two numbers, the same in every process.
_LOCK_NUMBERS = {"kind": 0x6165726F, "lock": 0x73657276}
_TRY = text("SELECT pg_try_advisory_lock(:kind, :lock)")
_HOLDER = text(
    "SELECT application_name FROM pg_stat_activity JOIN pg_locks USING (pid) "
    "WHERE locktype = 'advisory' AND classid = :kind AND objid = :lock AND objsubid = 2 "
    # A server has a lock of this number in each of its databases.
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)
# A server whose machine has failed is let go after a minute, not after the two hours of most systems.
_KEEPALIVE = {"tcp_keepalives_idle": "30", "tcp_keepalives_interval": "10", "tcp_keepalives_count": "3"}


class AnotherServerError(InstallationError):
    """Another server uses the database."""


class DatabaseClaim:
    """The lock of a PostgreSQL database, which is the database's and ends with the connection."""

    def __init__(self, records: Records) -> None:
        self._records = records
        self._connection: Connection | None = None
        self._taken: AnotherServerError | None = None

    def take(self) -> None:
        """Take the lock.

        Raises
        ------
        AnotherServerError
            If another server holds it.
        InstallationError
            If the database cannot be reached.
        """
        with in_words(self._records.address):
            connection = self._records.engine.connect().execution_options(isolation_level="AUTOCOMMIT")
            try:
                _hold_database(connection, self._records)
            except BaseException:
                _end(connection)
                raise
        self._connection = connection

    def keep(self, _is_over: Callable[[], bool] = lambda: False) -> None:
        """Take the lock again if the database was restarted since; it has then forgotten it.

        Raises
        ------
        InstallationError
            If the database cannot be reached.
        """
        if self._taken is not None or (self._connection is not None and _is_alive(self._connection)):
            return
        self.release()
        try:
            self.take()
        except AnotherServerError as error:
            self._taken = error

    def look(self) -> None:
        """Look whether another server has taken the database in between.

        Raises
        ------
        AnotherServerError
            If it has.
        """
        if self._taken is not None:
            raise self._taken

    def release(self) -> None:
        """Let go of the database."""
        if self._connection is not None:
            _end(self._connection)
        self._connection = None


@contextmanager
def only_server_of(records: Records, say: Say) -> Iterator[DatabaseClaim]:
    """Be the only server of a PostgreSQL database while the context lasts.

    A SQLite file is held by the lock of the state folder (`flows.server.state_file`).

    Raises
    ------
    InstallationError
        If another server holds it, or it cannot be reached.
    """
    claim = DatabaseClaim(records)
    if records.address.is_file:
        yield claim
        return
    trouble = "It cannot be ensured that this is the only server of its database"
    try:
        claim.take()
        with Repeated(claim.keep, _EVERY_S, say, trouble, grace_s=5.0):
            yield claim
    finally:
        claim.release()


def require_server_of(records: Records, seconds: float = 2.0 * _EVERY_S) -> None:
    """Make sure that a server uses a PostgreSQL database; nobody else looks at what is recorded there.

    Parameters
    ----------
    seconds : how long a server is waited for, which claims its database again after a restart of it.

    Raises
    ------
    InstallationError
        If none does, or the database cannot be reached.
    """
    if records.address.is_file:
        return
    until = time.monotonic() + seconds
    with in_words(records.address), records.engine.connect() as connection:
        while connection.execute(_HOLDER, _LOCK_NUMBERS).first() is None:
            if time.monotonic() >= until:
                raise InstallationError(
                    f"No server uses the database {records.address}.",
                    "Give the --database with which the server was started.",
                )
            time.sleep(0.2)


def _is_alive(connection: Connection) -> bool:
    try:
        connection.execute(text("SELECT 1"))
    # Of a broken connection the driver lets some errors pass as they are.
    except (DBAPIError, OSError):
        return False
    return True


def _end(connection: Connection) -> None:
    # Not handed back first, which fails if the database was restarted since.
    connection.invalidate()
    connection.close()


def _hold_database(connection: Connection, records: Records) -> None:
    # For the message to others; longer names are cut.
    ours = {"application_name": f"{machine()}, process {os.getpid()}"[-63:]}
    for name, value in (ours | _KEEPALIVE).items():
        connection.execute(text("SELECT set_config(:name, :value, false)"), {"name": name, "value": value})
    until = time.monotonic() + _LOOK_S
    while not connection.execute(_TRY, _LOCK_NUMBERS).scalar():
        if time.monotonic() > until:
            holder = connection.execute(_HOLDER, _LOCK_NUMBERS).scalar() or "unknown"
            raise AnotherServerError(
                f"Another server uses the database {records.address} ({holder}).",
                "Stop it first, or give this one another --database. More runs at the same time: --limit, "
                "aerocal runner.",
            )
        time.sleep(0.1)


@contextmanager
def claimed(inbox: Path | None) -> Iterator[None]:
    """Hold an inbox while the context lasts, if there is one.

    The lock is the operating system's and ends with the process. An inbox in which nothing can be written, or
    whose file system has no locks, is not held.

    Raises
    ------
    InstallationError
        If another server holds it.
    """
    handle = None if inbox is None else _opened(inbox)
    if inbox is None or handle is None:
        yield
        return
    try:
        _hold_inbox(handle, inbox)
        yield
    finally:
        os.close(handle)


def _opened(inbox: Path) -> int | None:
    try:
        return os.open(inbox / _LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError:
        return None


def _hold_inbox(handle: int, inbox: Path) -> None:
    until = time.monotonic() + _LOOK_S
    try:
        while not lock_if_free(handle):
            if time.monotonic() > until:
                holder = os.pread(handle, 200, 0).decode(errors="replace").strip() or "unknown"
                raise InstallationError(
                    f"Another server takes its deliveries from the inbox {inbox} ({holder}).",
                    "Stop it first, or give this one another --inbox. More runs at the same time: --limit, "
                    "aerocal runner.",
                )
            time.sleep(0.02)
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{machine()}, process {os.getpid()}\n".encode(), 0)
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP):
            raise
