"""Carry out ``aerocal undistort``: show the progress on a terminal, and what was written."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.progress import show_progress
from flows.command.screen_table import screen
from tasks.handover.undistorted.undistort import undistort


def write_undistorted(
    results: Path, images: list[Path], out: Path | None, camera: str | None, resampling: str
) -> int:
    """Write the images and show the statement; wrong input raises InputError."""
    console = show_progress()
    line = Progress(
        TextColumn("{task.description}"), BarColumn(30), TaskProgressColumn(), TimeRemainingColumn(),
        console=console, transient=True, redirect_stdout=False, redirect_stderr=False,
        disable=not (sys.stderr.isatty() and console.is_interactive),
    )  # fmt: skip
    with line:
        task = line.add_task("", total=1.0)
        written = undistort(
            results, images, out, camera, resampling,
            lambda file, done: line.update(task, description=file, completed=done),
        )  # fmt: skip
    shown = screen()
    shown.print(Text(written.statement))
    count = f"{len(written.files)} image{'s' if len(written.files) > 1 else ''}"
    where = f"{count}, cameras.csv and UNDISTORTED.txt are in {written.folder}."
    shown.print(Text(where), soft_wrap=True)
    return DONE
