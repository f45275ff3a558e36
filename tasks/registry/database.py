"""The database of a registry: transactions that readers and writers can rely on, and errors in words.

A writer holds the registry alone from its first statement to its commit (SQLite: ``BEGIN IMMEDIATE``;
PostgreSQL: the row of ``registry_head`` is locked), so that whatever it has read still holds when it writes.
A reader sees one state. A process that dies leaves nothing: what was not committed never was.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sqlalchemy import Connection, insert, inspect, select
from sqlalchemy.exc import IntegrityError

from tasks.database.address import DatabaseAddress
from tasks.database.engine import WAIT_S, Database, connected_for_reading, engine_at
from tasks.database.errors import in_words
from tasks.errors import InputError, Location
from tasks.files.delivered_file import is_there
from tasks.registry.history import BEGINNING
from tasks.registry.tables import HEAD, METADATA, RADIOMETRIC, RADIOMETRIC_HEAD, SCHEMA, SCHEMA_VERSION


@dataclass(frozen=True)
class RegistryDatabase(Database):
    """A registry's database."""

    schema, version = SCHEMA, SCHEMA_VERSION
    creation_lock = 0x6165726F63616C
    other_version = "export its records and add them to a new registry"

    @classmethod
    def at(cls, address: DatabaseAddress, wait_s: float = WAIT_S) -> RegistryDatabase:
        """The database at an address; nothing is opened yet.

        Parameters
        ----------
        wait_s : how long a writer waits for another one.
        """
        return cls(address, engine_at(address, wait_s))

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A transaction that sees one state of an existing registry.

        Raises
        ------
        InputError
            If there is no registry, or one of another version.
        InstallationError
            If the database cannot be reached.
        """
        file = self.address.file
        if file is not None and not is_there(file):
            raise self._missing()
        with in_words(self.address), connected_for_reading(self.engine) as connection:
            if not inspect(connection).has_table(SCHEMA.name):
                raise self._missing()
            self.require_version(connection)
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction with exclusive access; committed completely at its end, or not at all.

        The tables are made if there are none.

        Raises
        ------
        InputError
            If it is a registry of another version, or no registry, or another writer was faster.
        InstallationError
            If the database cannot be reached or written, or another writer does not come to an end.
        """
        try:
            with self.transaction() as connection:
                self._make_tables(connection)
                self.require_version(connection)
                connection.execute(select(HEAD.c.one).with_for_update()).all()
                yield connection
        except IntegrityError as error:
            raise InputError(
                "Another program has written to the registry at the same time without using aerocal: "
                f"{str(error.orig).splitlines()[0]}",
                "Nothing was changed. Run `aerocal registry verify`, then try again.",
            ) from error

    def _make_tables(self, connection: Connection) -> None:
        self.wait_to_create(connection)
        tables = inspect(connection)
        if tables.has_table(SCHEMA.name):
            # Those that it lacks, if an older version made it.
            METADATA.create_all(connection, tables=[RADIOMETRIC, RADIOMETRIC_HEAD])
            return
        if self.address.is_file and tables.get_table_names():
            raise Location(self.address.file).error(
                "This database belongs to another program: it has tables, but not those of a registry.",
                "Name a new file.",
            )
        METADATA.create_all(connection)
        connection.execute(insert(SCHEMA).values(version=SCHEMA_VERSION))
        connection.execute(insert(HEAD).values(one=1, calibrations=0, events=0, digest=BEGINNING))

    def _missing(self) -> InputError:
        return InputError(
            f"There is no registry at {self.address}.",
            "`aerocal registry add` creates one; --registry or AEROCAL_REGISTRY name another location.",
        )
