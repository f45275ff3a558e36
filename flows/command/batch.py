"""``aerocal batch``: many projects, each as if run alone, several at a time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from flows.command.exit_code import end_with
from flows.command.options import Dask, Data, Overrides

Stories: TypeAlias = Literal["aerial-triangulation", "system-calibration", "direct-georeferencing-check"]


def batch(
    projects: Annotated[
        list[Path],
        typer.Argument(
            metavar="PROJECT.toml ...", help="Project files, or folders with one project file each."
        ),
    ],
    story: Annotated[
        Stories | None,
        typer.Option(
            metavar="STORY",
            help="Flow to run: aerial-triangulation, system-calibration or direct-georeferencing-check.",
            show_default="the one that the project file declares",
        ),
    ] = None,
    output: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the output folder next to each project file.")
    ] = "results",
    overrides: Overrides = None,
    data: Data = None,
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Projects processed at the same time on this machine.",
            show_default="one per processor",
        ),
    ] = None,
    dask: Dask = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print only a JSON list of the projects on standard output.")
    ] = False,
) -> None:
    """Run many projects: one table of states, σ0 and check points.

    Each project is processed as by [bold]aerocal run[/bold], with its own output folder and lock, and the
    same results byte by byte. A failing project does not stop the others; completed stages are reused.

    [bold]Examples[/bold]

      aerocal batch flights/*/project.toml

      aerocal batch flights/* --story system-calibration --workers 4

      aerocal batch flights/* --dask tcp://HOST:8786 --json

    [bold]Exit codes[/bold]  that of the worst project, in this order: 1 error of the machine or of aerocal ·
    2 wrong input · 3 not computable · 4 gate failed · 0 all done
    """
    from flows.command.batch_execution import execute_batch

    end_with(
        lambda: execute_batch(
            projects, story, output, tuple(overrides or ()), data, workers, dask, as_json=json
        )
    )
