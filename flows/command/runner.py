"""``aerocal runner``: a further runner for the runs of a server."""

from __future__ import annotations

from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import Limit, Root, State
from flows.command.server_log import LogFormatOption, said_as


def runner(
    server: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Server whose runs are executed.",
            show_default="PREFECT_API_URL, otherwise this user's aerocal serve",
        ),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="The --database of that server; the password in PGPASSWORD.",
            show_default="that of this user's aerocal serve",
            envvar="AEROCAL_DATABASE",
        ),
    ] = None,
    root: Root = None,
    registry: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Registry of calibrations that runs use; the same as the server's.",
            show_default="AEROCAL_REGISTRY, else none",
        ),
    ] = None,
    results: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Prefix on object storage for results; the same as the server's.",
            show_default="next to each project",
        ),
    ] = None,
    limit: Limit = 1,
    state: State = None,
    log_format: LogFormatOption = "text",
) -> None:
    """Execute runs of a server alongside its own runner, on this machine or another.

    The folders of projects and the inbox must have the same paths as on the server's machine, and lie under a
    --root. After SIGTERM or Ctrl+C, it finishes current runs and stops; a second signal stops them as well.

    [bold]Examples[/bold]

      aerocal runner --root /data/projects --root /data/inbox --limit 2

      aerocal runner --server http://10.0.0.5:4200 --database postgresql://me@10.0.0.5/aerocal --root /data

    [bold]Exit codes[/bold]  0 stopped as requested · 2 an option is wrong · 1 it cannot start, or failed
    """
    given = dict(locals())
    say = said_as(given.pop("log_format"))

    def carry_out() -> int:
        from flows.server.settings import settings_of
        from flows.serving.further_runner import run_further_runner

        return run_further_runner(given.pop("server"), settings_of(given), say)

    end_with(carry_out)
