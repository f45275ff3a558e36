"""``aerocal undistort``: images with their distortion removed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import DONE, end_with
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
    end_with(lambda: _write_undistorted(results, images, out, camera, resampling))


def _write_undistorted(
    results: Path, images: list[Path], out: Path | None, camera: str | None, resampling: str
) -> int:
    """Show the progress on a terminal, and what was written."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.text import Text

    from flows.command.progress import show_progress
    from flows.command.screen_table import screen
    from tasks.handover.undistorted.undistort import undistort as write_undistorted

    console = show_progress()
    line = Progress(
        TextColumn("{task.description}"), BarColumn(30), TaskProgressColumn(), TimeRemainingColumn(),
        console=console, transient=True, redirect_stdout=False, redirect_stderr=False,
        disable=not (sys.stderr.isatty() and console.is_interactive),
    )  # fmt: skip
    with line:
        task = line.add_task("", total=1.0)
        written = write_undistorted(
            results, images, out, camera, resampling,
            lambda file, done: line.update(task, description=file, completed=done),
        )  # fmt: skip
    shown = screen()
    shown.print(Text(written.statement))
    count = f"{len(written.files)} image{'s' if len(written.files) > 1 else ''}"
    where = f"{count}, cameras.csv and UNDISTORTED.txt are in {written.folder}."
    shown.print(Text(where), soft_wrap=True)
    return DONE
