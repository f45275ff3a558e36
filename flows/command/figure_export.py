"""Carry out ``aerocal figures`` and report what was written."""

from __future__ import annotations

from pathlib import Path

from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.screen_table import screen
from tasks.documents.report.export import export_figures
from tasks.files.delivered_file import require_folder
from tasks.object_storage.address import output_folder
from tasks.stages.report import REPORT


def write_figures(results: Path, out: Path) -> int:
    """Write the figures of the report in a folder of results; without a report InputError is raised."""
    folder = output_folder(str(out))
    require_folder(folder)
    files = export_figures(results / REPORT, folder)
    console = screen()
    console.print(Text("\n".join(file.name for file in files)))
    console.print(Text(f"{len(files)} figures are in {out}."), soft_wrap=True)
    return DONE
