"""Transactions that readers and writers can rely on.

A writer has a SQLite file for itself from its first statement on (``BEGIN IMMEDIATE``), and waits for another
one only so long; on a server, what has to exclude each other locks a row. A process that dies leaves nothing:
what was not committed never was.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.pool import NullPool

from tasks.database.address import DatabaseAddress

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
