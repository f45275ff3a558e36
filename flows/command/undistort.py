"""``aerocal undistort``: images with their distortion removed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import FOLDER


def undistort(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder of a run.")],
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="TIFF, JPEG, PNG or JPEG 2000, as taken.")
    ],
    out: Annotated[
        Path | None, typer.Option(**FOLDER, help="Folder for the images; default RESULTS/undistorted.")
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Camera of the images, for images that are not in the block.",
            show_default="that of each image in the block",
        ),
    ] = None,
    resampling: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="[bold]cubic[/bold] (4 × 4 pixels), or [bold]lanczos[/bold] (6 × 6: sharper, a little "
            "slower, overshoots more at edges).",
        ),
    ] = "cubic",
) -> None:
    """Write images as a camera without distortion would have taken them.

    The image errors found by the adjustment (additional parameters, mean residuals) are removed. Bands, bit
    depth, compression, masks and metadata are unchanged. cameras.csv describes the camera without distortion,
    UNDISTORTED.txt the corrections; the orientations are those of the results.

    [bold]Examples[/bold]

      aerocal undistort results images/*.tif

      aerocal undistort results /data/flight/*.tif --out undistorted --camera "UC Eagle"

    [bold]Exit codes[/bold]  0 written · 2 wrong input · 1 rasterio is not installed, or no space
    """
    from flows.command.undistort_execution import write_undistorted

    end_with(lambda: write_undistorted(results, images, out, camera, resampling))
