"""Carry out ``aerocal init`` and show what was found."""

from __future__ import annotations

from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.screen_table import screen
from tasks.inventory.folder import Inventory, begin_project
from tasks.inventory.recognition import Content, rows_of

_KINDS = {
    "camera": ("camera", "cameras"),
    "exposures": ("exposure", "exposures"),
    "image_points": ("image point", "image points"),
    "control": ("control point", "control points"),
    "distances": ("distance", "distances"),
    "trajectory": ("sample of a trajectory", "samples of a trajectory"),
    "accuracy": ("accuracy of a trajectory", "accuracies of a trajectory"),
    "events": ("time of an exposure", "times of exposures"),
}


def initiate(folder: Path) -> int:
    """Write the project file and show the files; wrong input raises InputError."""
    found = begin_project(folder)
    console = screen()
    console.print(_table(found))
    console.print(Text(f"{found.project_file} was written.", style="bold"), soft_wrap=True)
    if found.open_values:
        word = "value" if found.open_values == 1 else "values"
        console.print(
            Text(f"{found.open_values} {word} must be declared: look for DECLARE. Then: aerocal doctor."),
            soft_wrap=True,
        )
    return DONE


def _table(found: Inventory) -> Table:
    table = Table("file", "format", "what", box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    root = found.project_file.parent
    for file in found.files:
        name = Text(file.path.relative_to(root).as_posix())
        if not file.contents:
            table.add_row(name, "–", Text(file.remark))
            continue
        formats = ", ".join(dict.fromkeys(content.format for content in file.contents))
        what = ", ".join(map(_counted, file.contents))
        table.add_row(name, formats, what)
    return table


def _counted(content: Content) -> str:
    """How many of what a file contains: ``1 camera``, ``84 control points``."""
    count = rows_of(content.records)
    return f"{count:,} {_KINDS[content.kind][count != 1]}"
