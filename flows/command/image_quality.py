"""``aerocal image-quality``: effective resolution, noise and defects of images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import FOLDER, Data, Json, Overrides, Server


def image_quality(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="PROJECT.toml|IMAGE", help=r"A TOML file with a table \[image_quality], or one image."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(**FOLDER, help="Output folder.", show_default="image-quality/ next to the source"),
    ] = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    json: Json = False,
) -> None:
    """Measure the quality of images: effective resolution at edges, and noise.

    Straight slanted edges are found over the whole image and adjusted to their pixels; homogeneous areas show
    the noise by grey level. Results: image_quality.html and tables. Needs the extra images.

    [bold]Examples[/bold]

      aerocal image-quality image.tif

      aerocal image-quality image.tif --set image_quality.gsd_m=0.05

      aerocal image-quality project.toml --out quality

    What is measured and how: docs/image-quality.md

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 4 done, but a limit of the sensor or a gate
    is not met
    """
    from flows.command.image_quality_execution import execute_image_quality

    end_with(lambda: execute_image_quality(source, out, tuple(overrides or ()), data, server, as_json=json))
