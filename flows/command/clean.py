"""``aerocal clean``: free disk space without touching published results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with


def clean(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Output folders, or folders that contain output folders."),
    ],
    older_than: Annotated[
        int,
        typer.Option(
            metavar="DAYS", help="Remove only what has not been used for this long.", min=0, max=36_500
        ),
    ] = 90,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Report what would be removed, and remove nothing.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only JSON on standard output.")] = False,
) -> None:
    """Remove stored results of stages (DIR/.store) that have not been used for a long time.

    Published files are kept, as are files listed in manifest.json and their inputs.

    Nothing is removed while a run is writing, or if manifest.json cannot be read.

    [bold]Examples[/bold]

      aerocal clean results --dry-run

      aerocal clean /data/projects --older-than 30

    [bold]Exit codes[/bold]  0 done · 2 no such folder
    """
    from flows.command.clean_table import execute_clean_up

    end_with(lambda: execute_clean_up(folders, older_than, "look" if dry_run else "remove", as_json=json))
