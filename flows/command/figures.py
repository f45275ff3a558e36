"""``aerocal figures``: the figures of a report as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import DONE, end_with
from flows.command.options import FOLDER


def figures(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder of a run.")],
    out: Annotated[
        Path | None, typer.Option(**FOLDER, help="Folder for the figures; default RESULTS/figures.")
    ] = None,
) -> None:
    """Write the figures of a report as SVG files, for papers and slides.

    They are identical to those of report.html: block, residuals, systematic image errors, correlations …

    [bold]Examples[/bold]

      aerocal figures results

      aerocal figures results --out paper/figures

    [bold]Exit codes[/bold]  0 done · 2 no report found
    """
    end_with(lambda: write_figures(results, out if out is not None else results / "figures"))


def write_figures(results: Path, out: Path) -> int:
    """Write the figures of the report in a folder of results; without a report InputError is raised."""
    from rich.text import Text

    from flows.command.screen_table import screen
    from tasks.documents.report.export import export_figures
    from tasks.files.delivered_file import require_folder
    from tasks.object_storage.address import output_folder
    from tasks.stages.report import REPORT

    folder = output_folder(str(out))
    require_folder(folder)
    files = export_figures(results / REPORT, folder)
    console = screen()
    console.print(Text("\n".join(file.name for file in files)))
    console.print(Text(f"{len(files)} figures are in {out}."), soft_wrap=True)
    return DONE
