"""Carry out ``aerocal init`` and show what was found."""

from __future__ import annotations

from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE
from tasks.inventory.folder import Inventory, begin_project
from tasks.inventory.recognition import rows_of

_KINDS = {
    "camera": "cameras",
    "exposures": "exposures",
    "image_points": "image points",
    "control": "control points",
    "distances": "distances",
    "trajectory": "samples of a trajectory",
    "accuracy": "accuracies of a trajectory",
    "events": "times of exposures",
}


def initiate(folder: Path) -> int:
    """Write the project file and show the files; wrong input raises InputError."""
    found = begin_project(folder)
    console = Console()
    console.print(_table(found))
    console.print(Text(f"{found.project_file} was written.", style="bold"), soft_wrap=True)
    if found.open_values:
        word = "value is" if found.open_values == 1 else "values are"
        console.print(
            Text(f"{found.open_values} {word} to be declared: look for DECLARE. Then: aerocal doctor."),
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
        what = ", ".join(f"{rows_of(content.records):,} {_KINDS[content.kind]}" for content in file.contents)
        table.add_row(name, formats, what)
    return table
