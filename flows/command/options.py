"""Arguments and options that several commands share."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, TypeAlias

import typer


def _folder(text: object) -> Path:
    """The folder that an option names; runs alone write to object storage (`Out`)."""
    name = str(text)
    if not name.strip():
        raise typer.BadParameter("The name is blank. Name a folder, or omit the option.")
    if re.match(r"[a-z][a-z0-9+.-]+:/", name, re.IGNORECASE):
        raise typer.BadParameter(f"'{name}' is an address. Name a folder on this machine.")
    return Path(name)


#: Of every other option that names a folder to write into.
FOLDER = {"parser": _folder, "metavar": "DIR"}

ProjectFile: TypeAlias = Annotated[Path, typer.Argument(metavar="PROJECT.toml", help="The project file.")]

Out: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--out",
        metavar="DIR|s3://…",
        help="Output folder, or [bold]s3://BUCKET/PREFIX[/bold] on object storage (endpoint, region and "
        "credentials from the environment).",
        show_default="results/ next to the project file",
    ),
]

Overrides: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the project file, e.g. [bold]--set adjustment.max_iterations=10[/bold]. "
        "Repeatable; VALUE is TOML, otherwise text; only the affected stages run again.",
    ),
]

SpecificationOverrides: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value of the specification, e.g. [bold]--set noise.level=0[/bold]. Repeatable.",
    ),
]

Seed: TypeAlias = Annotated[int | None, typer.Option(metavar="N", help="Seed of all random numbers.", min=0)]

Data: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--data",
        metavar="DIR",
        help="Folder of the delivered files: relative paths that are not found next to the project file "
        "are looked up here. Also the value of ${AEROCAL_TEST_DATA} if that is not set.",
    ),
]

Server: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--server",
        metavar="URL|none",
        help="Prefect server to which the run is reported; [bold]none[/bold] always runs in process.",
        show_default="PREFECT_API_URL, otherwise a running aerocal serve, otherwise in process",
    ),
]

Dask: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="ADDRESS|none",
        help="Scheduler of a Dask cluster whose workers compute the adjustments, e.g. "
        "[bold]tcp://HOST:8786[/bold]; [bold]none[/bold] always uses processes on this machine.",
        show_default="AEROCAL_DASK, otherwise processes on this machine",
    ),
]

Json: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print only the JSON summary on standard output.")
]

Root: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DIR",
        help="Folder that runs may read and write. Repeatable.",
        show_default="the current folder",
    ),
]

Limit: TypeAlias = Annotated[int, typer.Option(metavar="N", help="Number of simultaneous runs.", min=1)]

State: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder for state file, logs and Prefect's files.",
        show_default="in this user's state folder",
        envvar="AEROCAL_STATE",
    ),
]
