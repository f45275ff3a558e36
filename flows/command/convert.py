"""``aerocal convert``: deliveries in a block exchange format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import FOLDER, Data, Overrides


def convert(
    given: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="Project file, or a block of another program: BlocksExchange XML, sfm_data.json, an OPF "
            "project as zip file, a folder of COLMAP or OpenSfM.",
        ),
    ],
    to: Annotated[
        str,
        typer.Option(metavar="NAME", help="Block exchange format; [bold]aerocal export[/bold] lists them."),
    ],
    out: Annotated[
        Path | None, typer.Option(**FOLDER, help="Folder for the files; default NAME next to INPUT.")
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            metavar="KIND",
            help="As for [bold]aerocal export[/bold].",
            show_default="map coordinates if possible, otherwise local ones",
        ),
    ] = None,
    pixel_um: Annotated[
        float | None,
        typer.Option(metavar="UM", help="Pixel size, for blocks from programs that use pixel units only."),
    ] = None,
    overrides: Overrides = None,
    data: Data = None,
) -> None:
    """Write a delivery in a block exchange format, without adjusting it.

    Image points, control and cameras are written unchanged; orientations are the delivered ones, or
    approximate ones if there are none. HANDOVER.txt describes the files. To export adjusted results, use
    [bold]aerocal export[/bold].

    [bold]Examples[/bold]

      aerocal convert project.toml --to blocks-exchange

      aerocal convert block.xml --to colmap --pixel-um 4 --out model

    [bold]Exit codes[/bold]  0 written · 2 wrong input
    """
    from flows.command.convert_execution import convert_and_show

    end_with(
        lambda: convert_and_show(given, to, out, world, pixel_um, overrides=tuple(overrides or ()), data=data)
    )
