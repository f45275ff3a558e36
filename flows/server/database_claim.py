"""A database belongs to one server: a second one would remove the schedules of the first."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Connection, text

from tasks.database.errors import in_words
from tasks.files.installation import InstallationError
from tasks.files.machine import machine
from tasks.production.records import Records

#: How long a server that is ending is waited for, s.
_LOOK_S = 2.0
#: Any two numbers, the same in every process.
_LOCK = {"kind": 0x6165726F, "lock": 0x73657276}
_TRY = text("SELECT pg_try_advisory_lock(:kind, :lock)")
_HOLDER = text(
    "SELECT application_name FROM pg_stat_activity JOIN pg_locks USING (pid) "
    "WHERE locktype = 'advisory' AND classid = :kind AND objid = :lock AND objsubid = 2"
)
# A server whose machine has failed is let go after a minute, not after the two hours of most systems.
_KEEPALIVE = {"tcp_keepalives_idle": "30", "tcp_keepalives_interval": "10", "tcp_keepalives_count": "3"}


@contextmanager
def only_server_of(records: Records) -> Iterator[None]:
    """Be the only server of a PostgreSQL database while the context lasts.

    The lock is the database's and ends with the connection. A SQLite file is held by the lock of the state
    folder (`flows.server.state_file`).

    Raises
    ------
    InstallationError
        If another server holds it, or it cannot be reached.
    """
    if records.address.is_file:
        yield
        return
    with in_words(records.address):
        connection = records.engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    try:
        with in_words(records.address):
            _hold(connection, records)
        yield
    finally:
        # Not handed back first, which fails if the database was restarted since.
        connection.invalidate()
        connection.close()


def _hold(connection: Connection, records: Records) -> None:
    # For the message to others; longer names are cut.
    ours = {"application_name": f"{machine()}, process {os.getpid()}"[-63:]}
    for name, value in (ours | _KEEPALIVE).items():
        connection.execute(text("SELECT set_config(:name, :value, false)"), {"name": name, "value": value})
    until = time.monotonic() + _LOOK_S
    while not connection.execute(_TRY, _LOCK).scalar():
        if time.monotonic() > until:
            holder = connection.execute(_HOLDER, _LOCK).scalar() or "unknown"
            raise InstallationError(
                f"Another server uses the database {records.address} ({holder}).",
                "Stop it first, or give this one another --database. More runs at the same time: --limit, "
                "aerocal runner.",
            )
        time.sleep(0.1)
