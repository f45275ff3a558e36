"""``aerocal figures``: the figures of a report as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
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
    from flows.command.figure_export import write_figures

    end_with(lambda: write_figures(results, out if out is not None else results / "figures"))
