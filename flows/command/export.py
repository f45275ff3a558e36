"""``aerocal export``: results for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with


def export(
    results: Annotated[
        Path | None, typer.Argument(metavar="RESULTS", help="Results folder of a run.")
    ] = None,
    to: Annotated[
        str | None, typer.Option("--to", metavar="FORMAT", help="Format; without it, all formats are listed.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of the files; default RESULTS/export/FORMAT."),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            "--world",
            metavar="KIND",
            help="How the receiving program handles coordinates: [bold]local[/bold] (Cartesian, in "
            "our frame), [bold]map[/bold] (knows the projection and the curved earth), "
            "[bold]map-cartesian[/bold] (takes map coordinates as Cartesian), "
            "[bold]map-cartesian-curved[/bold] (the same, and corrects curvature).",
            show_default="the usual one of the format",
        ),
    ] = None,
    angles: Annotated[
        str, typer.Option("--angles", metavar="ORDER", help="omega-phi-kappa or phi-omega-kappa (eo-csv).")
    ] = "omega-phi-kappa",
    unit: Annotated[str, typer.Option("--unit", metavar="UNIT", help="deg, gon or rad (eo-csv).")] = "deg",
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Write even if the program's model differs from ours by a pixel or more."
        ),
    ] = False,
) -> None:
    """Hand results over to another program.

    What a program needs depends on how it handles coordinates, not on the file format.
    Each export says in HANDOVER.txt for which kind it is, what must be switched on and off, what was fitted,
    and how far the program's model differs from ours: half a pixel is reported, one is refused.

    [bold]Examples[/bold]

      aerocal export

      aerocal export results --to rpc

      aerocal export results --to patb --world local

      aerocal export results --to eo-csv --angles phi-omega-kappa --unit gon

    [bold]Exit codes[/bold]  0 written · 2 input wrong, or the misfit is too large
    """
    from flows.command.export_execution import list_formats, write_export

    if results is None or to is None:
        end_with(list_formats)
    else:
        end_with(lambda: write_export(results, to, out, world, angles, unit, force=force))
