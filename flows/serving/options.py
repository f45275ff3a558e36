"""What ``aerocal serve`` is asked to do."""

from __future__ import annotations

import json
import os
import socket
import zoneinfo
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import get_args
from urllib.parse import urlsplit

from flows.serving.calibrations import registry_of_server
from flows.serving.deliveries import StoryOfDeliveries
from flows.serving.door import Door, door_of
from flows.serving.results import results_of_server
from flows.serving.roots import Roots, roots_of
from flows.serving.server_process import ServerAddress
from flows.serving.state_file import state_folder
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.notification.notice import NoticeKind, wanted_kinds
from tasks.object_storage.address import ObjectAddress

#: When a registry is looked at, if nothing else is said: Mondays at six.
WEEKLY = "0 6 * * 1"


_LAST_PORT = 65535
#: Further names, separated by spaces, under which others reach this machine.
HOSTS_VARIABLE = "AEROCAL_HOSTS"


@dataclass(frozen=True)
class RunnerOptions:
    """What the runner is told.

    Attributes
    ----------
    limit : runs at the same time.
    has_inbox : whether there are deployments for deliveries.
    cron : when the inbox is looked through in any case; five fields; None: never.
    timezone : IANA name of the time zone the five fields are meant in.
    story : what is done with deliveries.
    recalibration_cron : when the registry of calibrations is looked at; None: there is no registry.
    keep_days : stored results of stages that nobody has used for so long are removed every night, unless a
        manifest names them; None: never.
    registers : whether it registers the deployments; else it is a further one beside the one that does.
    """

    limit: int = 1
    has_inbox: bool = False
    cron: str | None = None
    timezone: str = "UTC"
    story: StoryOfDeliveries = "aerial-triangulation"
    recalibration_cron: str | None = None
    keep_days: int | None = None
    registers: bool = True

    def require_valid(self) -> None:
        """Check what Prefect would only find out in the runner.

        Raises
        ------
        InputError
            If a schedule has no five fields or no inbox, or there is no such time zone.
        """
        if self.cron is not None and not self.has_inbox:
            raise InputError("There is a schedule, but no inbox.", "Add --inbox DIR.")
        for option, cron in (("--cron", self.cron), ("--recalibration-cron", self.recalibration_cron)):
            if cron is not None and len(cron.split()) != 5:
                raise InputError(
                    f"'{cron}' is not a schedule.",
                    f'Write minute, hour, day, month, weekday, e.g. {option} "30 1 * * *".',
                )
        try:
            zoneinfo.ZoneInfo(self.timezone)
        except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError) as error:
            raise InputError(
                f"There is no time zone '{self.timezone}'.", "Write an IANA name, e.g. Europe/Berlin."
            ) from error

    def as_text(self) -> str:
        """For the command line of the runner."""
        return json.dumps(asdict(self))


def options_from(text: str) -> RunnerOptions:
    """What `as_text` has written."""
    return RunnerOptions(**json.loads(text))


@dataclass(frozen=True)
class ServeOptions:
    """What the whole server is told.

    Attributes
    ----------
    address : where it listens.
    overview : where the production page listens.
    notify_on : what notices are about.
    database : ``postgresql://…`` of Prefect's records and ours; None: SQLite files in our folder.
    roots : folders that runs may read and write.
    inbox : folder of deliveries; None: there is none.
    watch_s : seconds between two looks into the inbox.
    registry : address of the registry of calibrations, password included; None: there is none.
    history_days : how long Prefect's server remembers runs that have ended.
    results : where runs keep their results on object storage, too; None: nowhere.
    runner : what the runner is told.
    state : folder of state file, logs and Prefect's own files.
    """

    address: ServerAddress
    overview: ServerAddress
    notify_on: frozenset[NoticeKind]
    database: str | None
    roots: Roots
    inbox: Path | None
    watch_s: float
    registry: str | None
    history_days: int
    results: ObjectAddress | None
    runner: RunnerOptions
    state: Path

    @property
    def records(self) -> str:
        """Address of the records of production, without a password."""
        return str(self.state / "records.sqlite") if self.database is None else self.database

    def door(self, words: str) -> Door:
        """Who is let in: who knows these words, and asks for this machine by one of its names."""
        hosts = [self.address.host, socket.gethostname(), *os.environ.get(HOSTS_VARIABLE, "").split()]
        return door_of(words, hosts, [self.address.public, self.overview.public])


def options_for(
    *,
    host: str,
    port: int,
    public_url: str | None,
    overview_port: int | None,
    public_overview_url: str | None,
    notify_on: str,
    database: str | None,
    roots: Sequence[Path],
    inbox: Path | None,
    story: str,
    watch_s: float,
    cron: str | None,
    timezone: str,
    registry: str | None,
    recalibration_cron: str | None,
    keep_days: int | None,
    history_days: int,
    results: str | None,
    limit: int,
    state: Path | None,
) -> ServeOptions:
    """Check what was given on the command line and put it together.

    Raises
    ------
    InputError
        If a folder does not exist, both ports are the same, the registry lies outside the folders, or the
        story, a schedule, the time zone or the address of results is none.
    InstallationError
        If the object storage of the results does not answer or refuses.
    """
    stories: tuple[StoryOfDeliveries, ...] = get_args(StoryOfDeliveries)
    known = next((one for one in stories if one == story), None)
    if known is None:
        raise InputError(f"There is no story '{story}'.", did_you_mean(story, stories))
    if database is not None and urlsplit(database).password is not None:
        # It would stand in the list of processes, and in the state file.
        raise InputError(
            "The address of the database holds a password.",
            "Put it into the environment: PGPASSWORD=…, and write postgresql://USER@HOST/DATABASE.",
        )
    if inbox is not None and not inbox.is_dir():
        raise InputError(f"There is no folder {inbox}.", "Correct --inbox, or make the folder.")
    confined = roots_of([*(roots or [Path.cwd()]), *([inbox] if inbox is not None else [])])
    calibrations = registry_of_server(registry, confined)
    if recalibration_cron is not None and calibrations is None:
        raise InputError("There is a schedule for calibrations, but no registry.", "Add --registry ADDRESS.")
    weekly = None if calibrations is None else recalibration_cron or WEEKLY
    runner = RunnerOptions(limit, inbox is not None, cron, timezone, known, weekly, keep_days)
    runner.require_valid()
    beside = overview_port or (port + 1 if port < _LAST_PORT else port - 1)
    if beside == port:
        raise InputError(f"Port {port} cannot serve both pages.", "Choose another one with --overview-port.")
    return ServeOptions(
        ServerAddress(host, port, _web_address("--public-url", public_url)),
        ServerAddress(host, beside, _web_address("--public-overview-url", public_overview_url)),
        wanted_kinds(notify_on),
        database,
        confined,
        None if inbox is None else inbox.resolve(),
        watch_s,
        calibrations,
        history_days,
        results_of_server(results, confined),
        runner,
        state_folder() if state is None else state.absolute(),
    )


def _web_address(option: str, text: str | None) -> str | None:
    """The address of a page that an option gives; None: it is not given."""
    if text is None:
        return None
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.query or parts.fragment:
        raise InputError(
            f"{option} is not the address of a web page.", "Write e.g. https://aerocal.example.org."
        )
    return text.rstrip("/")
