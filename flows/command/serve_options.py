"""The options of ``aerocal serve``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

HostOption: TypeAlias = Annotated[str, typer.Option("--host", help="Address to listen on.")]
PortOption: TypeAlias = Annotated[int, typer.Option("--port", help="Port to listen on.", min=1, max=65535)]
PublicUrlOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--public-url",
        metavar="URL",
        help="Address at which browsers reach the dashboard, behind a proxy or from other machines.",
    ),
]
PublicOverviewUrlOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--public-overview-url",
        metavar="URL",
        help="The same for the production page; used for links in the dashboard and in notices.",
    ),
]
OverviewPortOption: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--overview-port",
        help="Port of the production page.",
        min=1,
        max=65535,
        show_default="--port plus one",
    ),
]
DatabaseOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--database",
        metavar="URL",
        help="postgresql://USER@HOST/DATABASE of Prefect's own records; the password in PGPASSWORD.",
        show_default="a SQLite file in the state folder",
        envvar="AEROCAL_DATABASE",
    ),
]
RootsOption: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(
        "--root",
        metavar="DIR",
        help="Folder that runs may read and write. Repeatable.",
        show_default="the current folder",
    ),
]
InboxOption: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--inbox",
        metavar="DIR",
        help="Folder of deliveries, one folder each; a delivery starts when DELIVERED appears in it.",
    ),
]
StoryOption: TypeAlias = Annotated[str, typer.Option("--story", help="Flow to run for each delivery.")]
WatchOption: TypeAlias = Annotated[
    float, typer.Option("--watch", metavar="S", help="Seconds between two checks of the inbox.", min=1.0)
]
CronOption: TypeAlias = Annotated[
    str | None,
    typer.Option("--cron", metavar='"M H D M W"', help="Schedule of a full scan of the inbox."),
]
OnlyOnScheduleOption: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--only-on-schedule",
        help="Start deliveries by --cron alone, e.g. at night, not as soon as they are complete.",
    ),
]
TimezoneOption: TypeAlias = Annotated[str, typer.Option("--timezone", help="Time zone of all schedules.")]
RegistryOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--registry",
        metavar="URL",
        help="Registry of calibrations that runs use: a SQLite file under a --root, or "
        "postgresql://USER@HOST/DATABASE (password in PGPASSWORD).",
        show_default="AEROCAL_REGISTRY, otherwise none",
    ),
]
RecalibrationCronOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--recalibration-cron",
        metavar='"M H D M W"',
        help="Schedule of checks of the registry for calibrations that are due.",
        show_default='"0 6 * * 1" with a registry',
    ),
]
KeepDaysOption: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--keep-days",
        metavar="N",
        help="Every night, remove stored results of stages that have not been used for N days, but never "
        "those named by a manifest (see aerocal clean).",
        show_default="nothing is removed",
        min=1,
        max=36_500,
    ),
]
HistoryDaysOption: TypeAlias = Annotated[
    int,
    typer.Option(
        "--history-days",
        metavar="N",
        help="How long the dashboard keeps finished runs.",
        min=1,
        max=36_500,
    ),
]
ResultsOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--results",
        metavar="s3://…",
        help="Also keep results on object storage, below this address (endpoint, region and credentials "
        "from the environment).",
        show_default="next to the projects only",
    ),
]
LimitOption: TypeAlias = Annotated[
    int, typer.Option("--limit", metavar="N", help="Number of simultaneous runs.", min=1)
]
NotifyOnOption: TypeAlias = Annotated[
    str,
    typer.Option(
        "--notify-on",
        metavar="KINDS",
        help="Notices to send: gate, failure, recalibration, success. They are sent to the addresses in "
        "AEROCAL_NOTIFY, or in the file named by AEROCAL_NOTIFY_FILE.",
    ),
]
StateOption: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--state",
        metavar="DIR",
        help="Folder for state file, logs and Prefect's files.",
        show_default="in this user's state folder",
        envvar="AEROCAL_STATE",
    ),
]
