"""Settings of Prefect, made in one place before Prefect is imported.

Its home folder is ours, so profiles and databases of other Prefect projects of the same user have no
say; nothing is sent to anybody; results are not persisted (the stage store does that).
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit

from flows.server.api import Api
from flows.server.server_process import CLIENT_PASSWORD
from flows.server.state_file import bring_password_to, find_server
from tasks.files.installation import InstallationError
from tasks.files.state_folder import state_folder
from tasks.production.run_record import OVERVIEW_VARIABLE, RECORDS_VARIABLE

#: Seconds between two signs of life of a run.
HEARTBEAT_S = 30


class UnknownCallerError(InstallationError):
    """The server requires a password, and this process has none or a wrong one."""


def prepare_prefect(server: str | None = None) -> None:
    """Set Prefect's environment variables; without effect on what is set once Prefect is imported.

    Parameters
    ----------
    server : API address of the server that runs are reported to; None leaves PREFECT_API_URL as it is.
        A PREFECT_HOME set by the caller stays.
    """
    if server is not None:
        os.environ["PREFECT_API_URL"] = server
    if "prefect" in sys.modules:
        return
    home = os.environ.setdefault("PREFECT_HOME", str(state_folder() / "prefect"))
    with contextlib.suppress(OSError):
        # Prefect makes the folder, but not those above it; without it, it says so itself.
        Path(home).mkdir(mode=0o700, parents=True, exist_ok=True)
    os.environ["PREFECT_PROFILES_PATH"] = str(Path(home) / "profiles.toml")
    os.environ["DO_NOT_TRACK"] = "1"
    os.environ["PREFECT_SERVER_ANALYTICS_ENABLED"] = "false"
    os.environ["PREFECT_RESULTS_PERSIST_BY_DEFAULT"] = "false"
    os.environ.setdefault("PREFECT_FLOWS_HEARTBEAT_FREQUENCY", str(HEARTBEAT_S))
    # A server that is started again, or whose database is, answers within a minute or two; until then a
    # state is offered to it again and again (after 2, 4, 8, … s). A command keeps somebody waiting, and its
    # end is on record.
    os.environ.setdefault("PREFECT_CLIENT_MAX_RETRIES", "6" if server is None else "4")
    os.environ.setdefault("PREFECT_CLIENT_RETRY_EXTRA_CODES", "500")
    # A log of a server that runs for months has dates.
    os.environ.setdefault("PREFECT_LOGGING_FORMATTERS_STANDARD_DATEFMT", "%Y-%m-%d %H:%M:%S")
    # Our progress messages appear in the run's log on the dashboard.
    os.environ.setdefault("PREFECT_LOGGING_EXTRA_LOGGERS", "aerocal")


def server_address(option: str | None) -> str | None:
    """The API address that was requested: the option, else PREFECT_API_URL; None: none.

    Parameters
    ----------
    option : value of ``--server``: an address, ``none``, or None when it was not given. An address
        without a path means Prefect's usual ``/api``.
    """
    address = option if option is not None else os.environ.get("PREFECT_API_URL")
    if not address or address == "none":
        return None
    return address.rstrip("/") + ("" if urlsplit(address).path.strip("/") else "/api")


def server_to_report_to(option: str | None, remark: Callable[[str], None]) -> str | None:
    """The API address of a server that answers: as requested, else of ``aerocal serve``; None: in process.

    The records of production of the latter are from then on this process's, too.

    Parameters
    ----------
    option : as of `server_address`.
    remark : is told when a server that nobody requested cannot be used.

    Raises
    ------
    InstallationError
        If a server was requested and does not answer.
    """
    address = server_address(option)
    if address is not None:
        bring_password_to(address)
        require_server(address)
        return address
    found = None if option == "none" or os.environ.get("PREFECT_API_URL") == "none" else find_server()
    if found is None:
        return None
    where = f"The server {found.url} (process {found.pid})"
    if not found.alive:
        remark(f"{where} is no longer running; this run is not reported to it.")
        return None
    try:
        bring_password_to(found.url)
        require_server(found.url)
    except UnknownCallerError as error:
        remark(f"{where} asks for a password. {error.remedy} This run is not reported to it.")
        return None
    except InstallationError:
        remark(f"{where} does not answer; this run is not reported to it.")
        return None
    if found.records is not None:
        os.environ.setdefault(RECORDS_VARIABLE, found.records)
    if found.overview is not None:
        os.environ.setdefault(OVERVIEW_VARIABLE, found.overview)
    return found.url


def require_server(address: str, timeout_s: float = 5.0) -> None:
    """Check, without loading Prefect, that the server is healthy and accepts calls of this process.

    Raises
    ------
    UnknownCallerError
        If it asks for a password that this process does not have.
    InstallationError
        If it does not answer.
    """
    remedy = "Start it, correct the address, or run in process with --server none."
    if urlsplit(address).scheme not in ("http", "https"):
        raise InstallationError(f"'{address}' is not the address of a Prefect server.", remedy)
    api = Api(address, os.environ.get(CLIENT_PASSWORD) or None)
    try:
        for path in ("/health", "/version"):
            api.ask(path, timeout_s=timeout_s)
    except HTTPError as error:
        with error:
            if error.code == 401:
                raise UnknownCallerError(
                    f"The Prefect server {address} asks for a password.",
                    f"To report runs to it, set {CLIENT_PASSWORD}=user:password.",
                ) from error
        raise InstallationError(
            f"The Prefect server {address} does not answer like a Prefect server ({error}).", remedy
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise InstallationError(
            f"The Prefect server {address} does not answer ({reason}).", remedy
        ) from error
