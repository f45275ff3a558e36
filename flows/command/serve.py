"""``aerocal serve``: server, dashboard, deployments and runner in one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import Limit, Root, State
from flows.command.server_log import LogFormatOption, said_as


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(metavar="PORT", help="Port to listen on.", min=1, max=65535)] = 4200,
    public_url: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Address at which browsers reach the dashboard, behind a proxy or from other machines.",
        ),
    ] = None,
    public_overview_url: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="The same for the production page; used for links in the dashboard and in notices.",
        ),
    ] = None,
    overview_port: Annotated[
        int | None,
        typer.Option(
            metavar="PORT",
            help="Port of the production page.",
            min=1,
            max=65535,
            show_default="--port plus one",
        ),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="postgresql://USER@HOST/DB of Prefect's own records; the password in PGPASSWORD.",
            show_default="a SQLite file in the state folder",
            envvar="AEROCAL_DATABASE",
        ),
    ] = None,
    root: Root = None,
    inbox: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of deliveries, one folder each; a delivery starts when DELIVERED appears in it.",
        ),
    ] = None,
    story: Annotated[str, typer.Option(help="Flow to run for each delivery.")] = "aerial-triangulation",
    watch: Annotated[
        float, typer.Option(metavar="S", help="Seconds between two checks of the inbox.", min=1.0)
    ] = 20.0,
    cron: Annotated[
        str | None, typer.Option(metavar='"M H D M W"', help="Schedule of a full scan of the inbox.")
    ] = None,
    only_on_schedule: Annotated[
        bool,
        typer.Option(
            "--only-on-schedule",
            help="Start deliveries by --cron alone, e.g. at night, not as soon as they are complete.",
        ),
    ] = False,
    timezone: Annotated[
        str, typer.Option(help="Time zone of all schedules, and of times on the production page.")
    ] = "UTC",
    registry: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Registry of calibrations that runs use: a SQLite file under a --root, or "
            "postgresql://USER@HOST/DB (password in PGPASSWORD).",
            show_default="AEROCAL_REGISTRY, otherwise none",
        ),
    ] = None,
    recalibration_cron: Annotated[
        str | None,
        typer.Option(
            metavar='"M H D M W"',
            help="Schedule of checks of the registry for calibrations that are due.",
            show_default='"0 6 * * 1" with a registry',
        ),
    ] = None,
    keep_days: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Every night, remove stored results of stages that have not been used for N days, but never "
            "those named by a manifest (see aerocal clean).",
            show_default="nothing is removed",
            min=1,
            max=36_500,
        ),
    ] = None,
    history_days: Annotated[
        int, typer.Option(metavar="N", help="How long the dashboard keeps finished runs.", min=1, max=36_500)
    ] = 365,
    results: Annotated[
        str | None,
        typer.Option(
            metavar="s3://…",
            help="Also keep results on object storage, below this address (endpoint, region and credentials "
            "from the environment).",
            show_default="next to the projects only",
        ),
    ] = None,
    limit: Limit = 1,
    notify_on: Annotated[
        str,
        typer.Option(
            metavar="KINDS",
            help="Notices to send: gate, failure, recalibration, success. They are sent to the addresses in "
            "AEROCAL_NOTIFY, or in the file named by AEROCAL_NOTIFY_FILE.",
            show_default="gate, failure and recalibration",
        ),
    ] = "gate,failure,recalibration",
    state: State = None,
    log_format: LogFormatOption = "text",
) -> None:
    """Run the server: dashboard, deployments, and a runner that executes them.

    While it is running, [bold]aerocal run[/bold] and similar commands appear in the dashboard. After SIGTERM
    or Ctrl+C, it finishes current runs and stops; a second signal stops the runs as well.

    [bold]Examples[/bold]

      aerocal serve --root /data/projects

      aerocal serve --root /data --inbox /data/inbox --cron "30 1 * * *" --timezone Europe/Berlin

    [bold]Exit codes[/bold]  0 stopped as requested · 2 an option is wrong · 1 it cannot start, or failed
    """
    given = dict(locals())
    say = said_as(given.pop("log_format"))

    def carry_out() -> int:
        from flows.server.settings import settings_of
        from flows.serving.serve import serve as run_server

        return run_server(settings_of(given), say)

    end_with(carry_out)
