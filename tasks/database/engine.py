"""Transactions that readers and writers can rely on.

A writer has a SQLite file for itself from its first statement on (``BEGIN IMMEDIATE``), and waits for another
one only so long; on a server, what has to exclude each other locks a row. A process that dies leaves nothing:
what was not committed never was.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

from sqlalchemy import Connection, Engine, Table, create_engine, event, select, text
from sqlalchemy.pool import NullPool

from tasks.database.address import DatabaseAddress
from tasks.database.errors import in_words
from tasks.errors import InputError
from tasks.files.installation import writing_into

#: How long a writer waits for another one, s.
WAIT_S = 30
# A writer that hangs (not dies) must not hold up all others for ever.
_IDLE_S = 60
_WRITING = "aerocal_writing"


def engine_at(address: DatabaseAddress, wait_s: float = WAIT_S) -> Engine:
    """The engine of a database; no connection is opened yet.

    Parameters
    ----------
    wait_s : how long a writer waits for another one.
    """
    if address.is_file:
        engine = create_engine(address.url, poolclass=NullPool, connect_args={"timeout": wait_s})
        event.listen(engine, "connect", _leave_transactions_to_us)
        event.listen(engine, "begin", _begin_in_sqlite)
        return engine
    # Longer than any wait for a lock, so that the server has the first word.
    options = {"timeout": wait_s + 15, "ssl_context": address.ssl_context}
    engine = create_engine(address.url, poolclass=NullPool, connect_args=options, hide_parameters=True)
    event.listen(engine, "begin", _limits_of(wait_s))
    return engine


def connected_for_reading(engine: Engine) -> Connection:
    """A connection whose transaction sees one state."""
    in_file = engine.url.get_backend_name() == "sqlite"
    return engine.connect().execution_options(**({} if in_file else {"isolation_level": "REPEATABLE READ"}))


def connected_for_writing(engine: Engine) -> Connection:
    """A connection whose transaction may write."""
    in_file = engine.url.get_backend_name() == "sqlite"
    # Whoever has waited for a row lock must then see what the other one has written.
    options = {} if in_file else {"isolation_level": "READ COMMITTED"}
    return engine.connect().execution_options(**{_WRITING: True}, **options)


def _leave_transactions_to_us(connection: Any, _record: Any) -> None:
    """Prevent Python's driver from starting its own transactions late and deferred."""
    connection.isolation_level = None
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = FULL")


def _begin_in_sqlite(connection: Connection) -> None:
    writes = connection.get_execution_options().get(_WRITING, False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _limits_of(wait_s: float) -> Any:
    """The start of a transaction on a server, with time limits for waiting and for blocking others."""

    def begin(connection: Connection) -> None:
        if connection.get_execution_options().get(_WRITING, False):
            connection.exec_driver_sql(f"SET LOCAL lock_timeout = '{int(wait_s * 1000)}ms'")
            connection.exec_driver_sql(f"SET LOCAL idle_in_transaction_session_timeout = '{_IDLE_S}s'")

    return begin


@dataclass(frozen=True)
class Database:
    """A database whose tables have a version.

    Attributes
    ----------
    address : where it is.
    engine : connects to it.
    schema : the table of the version.
    version : of the tables that this program uses.
    creation_lock : any number, the same in every process: makers of the tables wait for each other on it.
    other_version : what to do about tables of another version.
    """

    schema: ClassVar[Table]
    version: ClassVar[int]
    creation_lock: ClassVar[int]
    other_version: ClassVar[str]

    address: DatabaseAddress
    engine: Engine

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """A transaction that may write; the folder of a file is made."""
        file = self.address.file
        if file is not None:
            with writing_into(file.parent, self.address.holding.named_by):
                file.parent.mkdir(parents=True, exist_ok=True)
        with in_words(self.address), connected_for_writing(self.engine) as connection, connection.begin():
            yield connection

    def wait_to_create(self, connection: Connection) -> None:
        """Be the only one that makes tables, until the end of the transaction."""
        if not self.address.is_file:
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": self.creation_lock})

    def require_version(self, connection: Connection) -> None:
        """Make sure that the tables have the version of this program.

        Raises
        ------
        InputError
            If they have another one.
        """
        versions = [row.version for row in connection.execute(select(self.schema.c.version))]
        if versions != [self.version]:
            found = " and ".join(map(str, versions)) or "none"
            raise InputError(
                f"The {self.address.holding.what} {self.address} has tables of version {found}, but this "
                f"version of aerocal uses version {self.version}.",
                f"Use the version of aerocal that created it, or {self.other_version}.",
            )
