"""The location of a database: a SQLite file on this machine, or a PostgreSQL server."""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from tasks.errors import InputError

#: PostgreSQL's own variable: keeps a password out of command lines and lists of processes.
PASSWORD_VARIABLE = "PGPASSWORD"
_SSL_MODES = ("disable", "require", "verify-full")
_FORMS = "Write the path of a SQLite file, sqlite:///PATH, or postgresql://USER@HOST/DATABASE."


@dataclass(frozen=True)
class Holding:
    """What is kept in a database, for messages.

    Attributes
    ----------
    what : e.g. ``registry``.
    named_by : where its address is given, e.g. ``--registry or AEROCAL_REGISTRY``.
    """

    what: str
    named_by: str


@dataclass(frozen=True)
class DatabaseAddress:
    """The location of a database.

    Attributes
    ----------
    url : for SQLAlchemy, password included; never to be printed.
    holding : what is kept there.
    ssl_mode : of a PostgreSQL connection; None: unencrypted unless the server insists.
    """

    url: URL
    holding: Holding
    ssl_mode: str | None = None

    @property
    def file(self) -> Path | None:
        """The SQLite file; None for a server."""
        return Path(self.url.database or "") if self.is_file else None

    @property
    def is_file(self) -> bool:
        """Whether it is a SQLite file."""
        return self.url.get_backend_name() == "sqlite"

    @property
    def ssl_context(self) -> ssl.SSLContext | bool:
        """The TLS settings of a connection to a server."""
        if self.ssl_mode in (None, "disable"):
            return False
        context = ssl.create_default_context()
        if self.ssl_mode == "require":
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        return context

    def __str__(self) -> str:
        if self.is_file:
            return str(self.file)
        return self.url.set(drivername="postgresql").render_as_string(hide_password=True)


def database_address(
    text: str, holding: Holding, environment: Mapping[str, str] = os.environ
) -> DatabaseAddress:
    """The database that a text denotes.

    Parameters
    ----------
    text : a path or a URL.

    Raises
    ------
    InputError
        If it is neither; the text is not repeated, for it may hold a password.
    """
    if "://" not in text:
        return _of_file(Path(text).expanduser(), holding)
    try:
        url = make_url(text)
        backend = url.get_backend_name()
    except (ArgumentError, ValueError) as error:
        raise InputError(f"The address of the {holding.what} is not valid.", _FORMS) from error
    if backend == "sqlite":
        if not url.database or url.database == ":memory:":
            raise InputError(f"The address of the {holding.what} names no file.", _FORMS)
        return _of_file(Path(url.database), holding)
    if backend not in ("postgresql", "postgres"):
        raise InputError(f"A {holding.what} cannot be kept in '{backend}'.", _FORMS)
    return _of_server(url, holding, environment)


def _of_file(path: Path, holding: Holding) -> DatabaseAddress:
    return DatabaseAddress(URL.create("sqlite", database=str(path.absolute())), holding)


def _of_server(url: URL, holding: Holding, environment: Mapping[str, str]) -> DatabaseAddress:
    mode = url.query.get("sslmode")
    unknown = sorted(set(url.query) - {"sslmode"})
    if unknown or (mode is not None and mode not in _SSL_MODES):
        what = f"sslmode={mode}" if not unknown else unknown[0]
        raise InputError(
            f"'{what}' is not valid in the address of the {holding.what}.",
            f"The only option is sslmode = {', '.join(_SSL_MODES)}.",
        )
    if not url.database:
        raise InputError(f"The address of the {holding.what} names no database.", _FORMS)
    password = url.password if url.password is not None else environment.get(PASSWORD_VARIABLE)
    user = url.username or environment.get("PGUSER") or environment.get("USER")
    url = url.set(drivername="postgresql+pg8000", username=user, password=password, query={})
    mode = None if mode is None else str(mode)
    return DatabaseAddress(url.set(host=url.host or "localhost"), holding, mode)
