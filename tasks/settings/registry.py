"""Where the registry of calibrations is: an option, the environment, or the user's data folder."""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import platformdirs
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from tasks.errors import InputError

#: The variable that names the registry; ``--registry`` goes before it.
REGISTRY_VARIABLE = "AEROCAL_REGISTRY"
#: PostgreSQL's own variable: keeps a password out of command lines and lists of processes.
PASSWORD_VARIABLE = "PGPASSWORD"
_SSL_MODES = ("disable", "require", "verify-full")
_FORMS = "Write the path of a SQLite file, sqlite:///PATH, or postgresql://USER@HOST/DATABASE."


@dataclass(frozen=True)
class RegistryAddress:
    """The database of a registry.

    Attributes
    ----------
    url : for SQLAlchemy, password included; never to be printed.
    ssl_mode : of a PostgreSQL connection; None: unencrypted unless the server insists.
    """

    url: URL
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
        """How a server is spoken to."""
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


def registry_address(
    option: str | None = None, environment: Mapping[str, str] = os.environ
) -> RegistryAddress:
    """The registry that is meant: the option, else the environment, else a file of this user.

    Parameters
    ----------
    option : value of ``--registry``; a path or a URL.

    Raises
    ------
    InputError
        If it is neither; the text is not repeated, for it may hold a password.
    """
    text = option or environment.get(REGISTRY_VARIABLE)
    if not text:
        return _of_file(Path(platformdirs.user_data_dir("aerocal")) / "registry.sqlite")
    if "://" not in text:
        return _of_file(Path(text).expanduser())
    try:
        url = make_url(text)
        backend = url.get_backend_name()
    except (ArgumentError, ValueError) as error:
        raise InputError("The address of the registry is not understood.", _FORMS) from error
    if backend == "sqlite":
        if not url.database or url.database == ":memory:":
            raise InputError("The address of the registry names no file.", _FORMS)
        return _of_file(Path(url.database))
    if backend not in ("postgresql", "postgres"):
        raise InputError(f"A registry cannot be kept in '{backend}'.", _FORMS)
    return _of_server(url, environment)


def _of_file(path: Path) -> RegistryAddress:
    return RegistryAddress(URL.create("sqlite", database=str(path.absolute())))


def _of_server(url: URL, environment: Mapping[str, str]) -> RegistryAddress:
    mode = url.query.get("sslmode")
    unknown = sorted(set(url.query) - {"sslmode"})
    if unknown or (mode is not None and mode not in _SSL_MODES):
        what = f"sslmode={mode}" if not unknown else unknown[0]
        raise InputError(
            f"'{what}' is not understood in the address of the registry.",
            f"The only option is sslmode = {', '.join(_SSL_MODES)}.",
        )
    if not url.database:
        raise InputError("The address of the registry names no database.", _FORMS)
    password = url.password if url.password is not None else environment.get(PASSWORD_VARIABLE)
    user = url.username or environment.get("PGUSER") or environment.get("USER")
    url = url.set(drivername="postgresql+pg8000", username=user, password=password, query={})
    return RegistryAddress(url.set(host=url.host or "localhost"), None if mode is None else str(mode))
