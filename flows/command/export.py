"""``aerocal export``: results for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import FOLDER


def export(
    results: Annotated[
        Path | None, typer.Argument(metavar="RESULTS", help="Results folder of a run.")
    ] = None,
    to: Annotated[
        str | None, typer.Option(metavar="FORMAT", help="Format; without it, all formats are listed.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(**FOLDER, help="Folder for the files; default RESULTS/export/FORMAT.")
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            metavar="KIND",
            help="How the receiving program handles coordinates: [bold]local[/bold] (Cartesian, in "
            "our frame), [bold]map[/bold] (handles map projection and earth curvature), "
            "[bold]map-cartesian[/bold] (treats map coordinates as Cartesian), "
            "[bold]map-cartesian-curved[/bold] (the same, but corrects earth curvature).",
            show_default="the usual one for the format",
        ),
    ] = None,
    angles: Annotated[
        str, typer.Option(metavar="ORDER", help="omega-phi-kappa or phi-omega-kappa (eo-csv).")
    ] = "omega-phi-kappa",
    unit: Annotated[str, typer.Option(metavar="UNIT", help="deg, gon or rad (eo-csv).")] = "deg",
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Write even if the program's model differs from ours by one pixel or more."
        ),
    ] = False,
) -> None:
    """Export results for other programs.

    What a program needs depends on how it handles coordinates, not on the file format.
    HANDOVER.txt of each export states the kind of program, the corrections to be switched on or off, what was
    fitted, and how far the model of the program differs from ours: a difference of half a pixel or more is
    reported; with one pixel or more, the export is refused.

    [bold]Examples[/bold]

      aerocal export

      aerocal export results --to rpc

      aerocal export results --to patb --world local

      aerocal export results --to eo-csv --angles phi-omega-kappa --unit gon

    [bold]Exit codes[/bold]  0 written · 2 wrong input, or the misfit is too large
    """
    if to is None:
        from flows.command.format_table import list_formats

        end_with(list_formats)
    elif results is None:
        raise typer.BadParameter("Name the results folder of a run before --to.")
    else:
        from flows.command.export_execution import write_export

        end_with(lambda: write_export(results, to, out, world, angles, unit, force=force))
