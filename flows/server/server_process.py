"""Prefect's server: where it listens, and the variables of its process."""

from __future__ import annotations

import ipaddress
import os
import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass

from flows.server.door import DOOR_VARIABLE, Door
from tasks.files.installation import InstallationError

#: Prefect's own variable of the password (``user:password``) a server asks for.
SERVER_PASSWORD = "PREFECT_SERVER_API_AUTH_STRING"
_DAY_S = 86_400
#: The same on the side of those who ask it.
CLIENT_PASSWORD = "PREFECT_API_AUTH_STRING"


@dataclass(frozen=True)
class ServerAddress:
    """Where the server listens.

    Attributes
    ----------
    host, port : address and port.
    public : address under which browsers reach it (behind a proxy, from other machines); None: as it is here.
    """

    host: str
    port: int
    public: str | None = None

    @property
    def base(self) -> str:
        """Address for programs on this machine."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"

    @property
    def dashboard(self) -> str:
        """Address of the dashboard for browsers."""
        if self.public is not None:
            return self.public.rstrip("/")
        # Listening everywhere is not an address that a browser could open.
        everywhere = self.host in ("0.0.0.0", "::")
        return f"http://{socket.gethostname()}:{self.port}" if everywhere else self.base

    @property
    def api(self) -> str:
        """Address of the API."""
        return f"{self.base}/api"

    @property
    def is_loopback(self) -> bool:
        """Whether only programs on this machine can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def require_free(self, option: str = "--port") -> None:
        """Make sure that no program listens there.

        Parameters
        ----------
        option : names another port.

        Raises
        ------
        InstallationError
            If the port is taken, or the host is none of this machine.
        """
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                trial.bind((self.host, self.port))
            except OSError as error:
                raise InstallationError(
                    f"Cannot listen on {self.host} port {self.port} ({error.strerror or error}).",
                    f"Choose another one with {option}, or end the program that uses it.",
                ) from error


def server_environment(
    address: ServerAddress,
    database: str | None,
    door: Door,
    environment: Mapping[str, str] = os.environ,
    *,
    history_days: int = 365,
) -> dict[str, str]:
    """The variables of the server's process.

    Parameters
    ----------
    database : ``postgresql://…``, or None for Prefect's SQLite file in our folder.
    door : who is let in.
    history_days : how long runs that have ended are remembered, with their logs and artifacts. Which
        deliveries have been done is remembered elsewhere (`tasks.production.records`).

    Raises
    ------
    InstallationError
        If the database is not valid.
    """
    settings = {
        "PREFECT_SERVER_API_HOST": address.host,
        "PREFECT_SERVER_API_PORT": str(address.port),
        SERVER_PASSWORD: door.password,
        DOOR_VARIABLE: door.as_variable(),
        # That of the page itself, so that every name of this machine will do.
        "PREFECT_SERVER_UI_API_URL": "/api",
        # Pages of other origins may not start runs through the browser of somebody who is here.
        "PREFECT_SERVER_CORS_ALLOWED_ORIGINS": address.dashboard,
        "PREFECT_SERVER_UI_SHOW_PROMOTIONAL_CONTENT": "false",
        # By itself Prefect forgets events only, after a week, and runs never.
        "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "events,flow_runs",
        "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(history_days * _DAY_S),
    }
    if database is not None:
        settings |= _connection(database)
    # A server that is told of another one would report to it.
    kept = {name: value for name, value in environment.items() if name != "PREFECT_API_URL"}
    return {**kept, **settings}


def _connection(database: str) -> dict[str, str]:
    found = re.match(r"(?:postgresql|postgres)(?:\+asyncpg)?://([^?]+)(?:\?sslmode=([a-z-]+))?", database)
    if found is None:
        raise InstallationError(
            "The address of the database is not valid.",
            "Write postgresql://USER@HOST/DATABASE with the password in PGPASSWORD, or omit --database.",
        )
    address, mode = found.groups()
    if mode == "verify-full":
        # By itself asyncpg wants a file of certificates in the home folder; we trust those of the system.
        encrypted, verified = "", {"PREFECT_SERVER_DATABASE_SQLALCHEMY_CONNECT_ARGS_TLS_ENABLED": "true"}
    else:
        encrypted, verified = "" if mode is None else f"?ssl={mode}", {}
    return {
        "PREFECT_SERVER_DATABASE_CONNECTION_URL": f"postgresql+asyncpg://{address}{encrypted}",
        **verified,
    }
