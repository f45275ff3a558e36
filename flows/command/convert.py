"""``aerocal convert``: deliveries in a format of block exchange."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import Data, Overrides


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
        typer.Option(
            "--to", metavar="NAME", help="Format of block exchange; [bold]aerocal export[/bold] lists."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of the files; default NAME beside INPUT."),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(
            "--world",
            metavar="KIND",
            help="As of [bold]aerocal export[/bold].",
            show_default="map coordinates as they are, else local ones",
        ),
    ] = None,
    pixel_um: Annotated[
        float | None,
        typer.Option(
            "--pixel-um", metavar="UM", help="Side of a pixel, for blocks of programs that know pixels only."
        ),
    ] = None,
    overrides: Overrides = None,
    data: Data = None,
) -> None:
    """Write a delivery in a format of block exchange, without adjusting it.

    Image points, control and cameras go along as they are; orientations are the delivered ones, and
    approximate ones where there are none. HANDOVER.txt says what was written. To hand over adjusted results,
    use [bold]aerocal export[/bold].

    [bold]Examples[/bold]

      aerocal convert project.toml --to blocks-exchange

      aerocal convert block.xml --to colmap --pixel-um 4 --out model

    [bold]Exit codes[/bold]  0 written · 2 input wrong
    """
    from flows.command.convert_execution import convert_and_show

    end_with(
        lambda: convert_and_show(given, to, out, world, pixel_um, overrides=tuple(overrides or ()), data=data)
    )
