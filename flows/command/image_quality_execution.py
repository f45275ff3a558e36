"""Carry out ``aerocal image-quality`` and show the factors of the bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from rich.table import Table
from rich.text import Text

from flows.command.execution import ended, outcome_of
from flows.command.screen_table import figure, print_listed, screen, screen_table
from flows.runs.examination_request import ExaminationRequest
from flows.runs.project_run import RunOutcome
from flows.stories.image_quality import image_quality, stages_of
from tasks.files.json_text import JSON


def execute_image_quality(
    source: Path,
    out: Path | None,
    overrides: tuple[str, ...],
    data: Path | None,
    server: str | None,
    *,
    as_json: bool,
) -> int:
    """Run, and show the result; returns the exit code. Wrong settings raise InputError."""
    request = ExaminationRequest(source, out, overrides, data)
    outcome = outcome_of(
        request, "image_quality", lambda: image_quality, server, lambda: stages_of(request.read())
    )
    return ended(outcome, _show, as_json=as_json)


def _show(outcome: RunOutcome) -> None:
    """Problems, a line for each band of scenes, and where the page is."""
    console, summary = screen(), outcome.summary
    print_listed(console, summary.problems, "yellow")
    for gate in summary.gates:
        if not gate.passed:
            value, limit = gate.words
            console.print(Text(f"Gate {gate.name}: {value}, limit {limit}: failed", style="red"))
    figures = (summary.model_extra or {}).get("image_quality")
    if figures is not None:
        console.print(_bands(figures))
    console.print(Text(f"\nPage: {outcome.directory / 'image_quality.html'}"), soft_wrap=True)


def _bands(figures: Mapping[str, JSON]) -> Table:
    headings = ("band", "edges", "factor", "± σ", "MTF50 1/px", "at Nyquist", "sharpened")
    table = screen_table(*headings, right=headings)
    for row in cast(Sequence[Mapping[str, JSON]], figures["bands"]):
        numbers = [figure(cast(float | None, row[name]), 3) for name in _NUMBERS]
        table.add_row(str(row["band"]), str(row["edges"]), *numbers, "yes" if row["sharpened"] else "no")
    return table


_NUMBERS = ("factor", "sigma_factor", "mtf50", "mtf_nyquist")
