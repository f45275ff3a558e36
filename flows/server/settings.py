"""Settings of ``aerocal serve`` and ``aerocal runner``: one object, from the options to the last process.

Prefect has settings of its own and none for projects, inbox, registry and results. The object travels whole
to the runner, in one variable of its environment. What a run needs to know is in variables as well, the
same that Prefect's own workers are given (``deploy/prefect.yaml``).
"""

from __future__ import annotations

import os
import socket
import zoneinfo
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_args
from urllib.parse import urlsplit

from cronsim import CronSim, CronSimError
from pydantic import TypeAdapter

from flows.server.door import Door, door_of
from flows.server.inbox import INBOX_VARIABLE, StoryOfDeliveries
from flows.server.roots import (
    RESULTS_VARIABLE,
    ROOTS_VARIABLE,
    Roots,
    as_variable,
    registry_of_server,
    results_of_server,
    roots_of,
)
from flows.server.server_process import ServerAddress
from tasks.errors import InputError
from tasks.files.state_folder import STATE_VARIABLE, state_folder
from tasks.nearest_name import did_you_mean
from tasks.object_storage.address import ObjectAddress
from tasks.plain_text import visible
from tasks.production.notice import USUAL, NoticeKind, wanted_kinds
from tasks.production.run_record import OVERVIEW_VARIABLE, RECORDS_VARIABLE
from tasks.settings.registry import REGISTRY_VARIABLE

#: When a registry is looked at, if nothing else is said: Mondays at six.
WEEKLY = "0 6 * * 1"
#: Further names, separated by spaces, under which others reach this machine.
HOSTS_VARIABLE = "AEROCAL_HOSTS"
#: Carries the settings to a runner.
SETTINGS_VARIABLE = "AEROCAL_SETTINGS"
_LAST_PORT = 65535
#: Options that are settings as they stand.
_AS_GIVEN = ("database", "cron", "timezone", "keep_days", "history_days", "limit", "only_on_schedule")
_SERVER, _PAGE = (ServerAddress("127.0.0.1", port) for port in (4200, 4201))


@dataclass(frozen=True)
class Settings:
    """Settings of a server and its runners.

    Attributes
    ----------
    roots : folders that runs may read and write.
    state : folder of state file, logs and Prefect's own files.
    address, overview : where server and production page listen, of a further runner those it works for.
    database : ``postgresql://…`` of Prefect's records and ours; None: SQLite files in our folder.
    notify_on : what notices are about.
    inbox : folder of deliveries; None: there is none.
    story : what is done with deliveries.
    watch_s : seconds between two looks into the inbox.
    cron : when the inbox is looked through in any case; five fields; None: never.
    timezone : IANA name of the time zone the five fields are meant in, and that of the production page.
    registry : address of the registry of calibrations, password included; None: there is none.
    recalibration_cron : when the registry is looked at; None: there is no registry.
    keep_days : stored results of stages that nobody has used for so long are removed every night, unless a
        manifest names them; None: never.
    history_days : how long Prefect's server remembers runs that have ended.
    results : where runs keep their results on object storage, too; None: nowhere.
    limit : runs at the same time.
    registers : whether the runner registers the deployments; a further one does not.
    only_on_schedule : whether deliveries wait for the schedule, e.g. for the night.
    """

    roots: Roots
    state: Path
    address: ServerAddress = _SERVER
    overview: ServerAddress = _PAGE
    database: str | None = None
    notify_on: frozenset[NoticeKind] = frozenset(USUAL)
    inbox: Path | None = None
    story: StoryOfDeliveries = "aerial-triangulation"
    watch_s: float = 20.0
    cron: str | None = None
    timezone: str = "UTC"
    registry: str | None = None
    recalibration_cron: str | None = None
    keep_days: int | None = None
    history_days: int = 365
    results: ObjectAddress | None = None
    limit: int = 1
    registers: bool = True
    only_on_schedule: bool = False

    @property
    def records(self) -> str:
        """Address of the records of production, without a password."""
        return str(self.state / "records.sqlite") if self.database is None else self.database

    def door(self, password: str) -> Door:
        """The rules of access: this password, and this machine under one of its names."""
        hosts = [self.address.host, socket.gethostname(), *os.environ.get(HOSTS_VARIABLE, "").split()]
        return door_of(password, hosts, [self.address.public, self.overview.public])

    def variables(self) -> dict[str, str]:
        """The variables of a runner and of the runs it starts."""
        given = {
            SETTINGS_VARIABLE: _SETTINGS.dump_json(self).decode(),
            ROOTS_VARIABLE: as_variable(self.roots),
            RECORDS_VARIABLE: self.records,
            STATE_VARIABLE: str(self.state),
            RESULTS_VARIABLE: "" if self.results is None else str(self.results),
            # A further runner may not know it.
            OVERVIEW_VARIABLE: self.overview.dashboard if self.overview.host else self.overview.public,
            INBOX_VARIABLE: None if self.inbox is None else str(self.inbox),
            REGISTRY_VARIABLE: self.registry,
        }
        return {name: value for name, value in given.items() if value is not None}


_SETTINGS = TypeAdapter(Settings)


def settings_of_runner(environment: Mapping[str, str] = os.environ) -> Settings:
    """The settings that this runner was started with."""
    return _SETTINGS.validate_json(environment[SETTINGS_VARIABLE])


def settings_of(given: Mapping[str, Any]) -> Settings:
    """Check the options of the command line.

    Parameters
    ----------
    given : values of the options of ``aerocal serve`` by their names; what is missing is as usual.

    Raises
    ------
    InputError
        If a folder does not exist, both ports are the same, the registry lies outside the folders, or the
        story, a schedule, the time zone, an address of a page or that of results is none.
    InstallationError
        If the object storage of the results does not answer or refuses.
    """
    plain = {name: given[name] for name in _AS_GIVEN if given.get(name) is not None}
    inbox, database, state = (given.get(name) for name in ("inbox", "database", "state"))
    cron, recalibration_cron = given.get("cron"), given.get("recalibration_cron")
    stories: tuple[StoryOfDeliveries, ...] = get_args(StoryOfDeliveries)
    story = given.get("story") or stories[0]
    if story not in stories:
        raise InputError(f"There is no story '{story}'.", did_you_mean(story, stories))
    if database is not None and urlsplit(database).password is not None:
        # It would be in the list of processes, and in the state file.
        raise InputError(
            "The address of the database contains a password.",
            "Put it into the environment: PGPASSWORD=…, and write postgresql://USER@HOST/DATABASE.",
        )
    if inbox is not None and not inbox.is_dir():
        raise InputError(f"There is no folder {inbox}.", "Correct --inbox, or create the folder.")
    roots = roots_of([*(given.get("root") or [Path.cwd()]), *([inbox] if inbox is not None else [])])
    registry = registry_of_server(given.get("registry"), roots)
    if recalibration_cron is not None and registry is None:
        raise InputError("There is a schedule for calibrations, but no registry.", "Add --registry ADDRESS.")
    if cron is not None and inbox is None:
        raise InputError("There is a schedule, but no inbox.", "Add --inbox DIR.")
    if given.get("only_on_schedule") and cron is None:
        raise InputError("Deliveries wait for a schedule, and there is none.", 'Add --cron "M H D M W".')
    _require_schedule("--cron", cron)
    _require_schedule("--recalibration-cron", recalibration_cron)
    _require_zone(given.get("timezone", "UTC"))
    host, port = given.get("host", "127.0.0.1"), given.get("port", 4200)
    beside = given.get("overview_port") or (port + 1 if port < _LAST_PORT else port - 1)
    if beside == port:
        raise InputError(f"Port {port} cannot serve both pages.", "Choose another one with --overview-port.")
    return Settings(
        roots,
        state_folder() if state is None else state.absolute(),
        ServerAddress(host, port, _web_address("--public-url", given.get("public_url"))),
        ServerAddress(host, beside, _web_address("--public-overview-url", given.get("public_overview_url"))),
        notify_on=wanted_kinds(given.get("notify_on", ",".join(USUAL))),
        inbox=None if inbox is None else inbox.resolve(),
        story=story,
        watch_s=given.get("watch", 20.0),
        registry=registry,
        recalibration_cron=None if registry is None else recalibration_cron or WEEKLY,
        results=results_of_server(given.get("results"), roots),
        **plain,
    )


def _require_schedule(option: str, cron: str | None) -> None:
    """Check the schedule, which Prefect would do only in the runner."""
    if cron is None:
        return
    try:
        if len(cron.split()) != 5:
            raise CronSimError("Not five fields")
        CronSim(cron, datetime.now(UTC))
    except CronSimError as error:
        raise InputError(
            f"'{cron}' is not a schedule ({error}).",
            f'Write minute, hour, day, month, weekday, e.g. {option} "30 1 * * *".',
        ) from error


def _require_zone(name: str) -> None:
    try:
        zoneinfo.ZoneInfo(name)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise InputError(
            f"There is no time zone '{name}'.", "Write an IANA name, e.g. Europe/Berlin."
        ) from error


def _web_address(option: str, text: str | None) -> str | None:
    """The address of a page that an option gives; None: it is not given."""
    if text is None:
        return None
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.query or parts.fragment:
        raise InputError(
            f"{option} is not the address of a web page.", "Write e.g. https://aerocal.example.org."
        )
    if parts.path.strip("/"):
        # The pages ask for their parts at the root of their host.
        raise InputError(
            f"{option} contains a path ({visible(parts.path)}).",
            "Give each page a host name or a port of its own in the proxy.",
        )
    return text.rstrip("/")
