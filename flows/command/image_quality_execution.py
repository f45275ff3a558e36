"""Carry out ``aerocal image-quality`` and show the factors of the bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import OF_STATUS, complain, remark
from flows.command.living_line import living_line
from flows.command.progress import show_progress
from flows.command.screen_table import figure, screen_table
from flows.runs.examination_request import ExaminationRequest
from flows.runs.project_run import RunOutcome, carry_out
from flows.server.prefect_settings import prepare_prefect, server_to_report_to
from flows.stories.image_quality import image_quality, stages_of
from tasks.files.json_text import JSON, json_text
from tasks.results.summary import Summary


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
    address = server_to_report_to(server, remark)
    console = show_progress(on_screen=address is None)
    if address is None:
        with living_line(console, request.directory, stages_of(request.read())):
            outcome = carry_out(image_quality, request)
    else:
        outcome = _reported_to(address, request)
    if as_json:
        print(json_text(outcome.summary.to_json(), indent=2))
    elif outcome.error is None:
        _show(outcome.summary, outcome.directory)
    if outcome.error is not None:
        complain(outcome.error)
    return OF_STATUS[outcome.summary.status]


def _reported_to(address: str, request: ExaminationRequest) -> RunOutcome:
    """Run as a Prefect flow: the work is done here, the server sees states and logs."""
    prepare_prefect(address)
    from flows.serving import registered

    return registered.run_and_report(request, registered.image_quality)


def _show(summary: Summary, directory: Path) -> None:
    """Problems, a line for each band of scenes, and where the page is."""
    console = Console()
    for sentence in summary.problems:
        console.print(Text(f"• {sentence}", style="yellow"))
    for gate in summary.gates:
        if not gate.passed:
            value = "none" if gate.value is None else f"{gate.value:g}"
            console.print(Text(f"Gate {gate.name}: {value}, limit {gate.limit:g}: failed", style="red"))
    figures = (summary.model_extra or {}).get("image_quality")
    if figures is not None:
        console.print(_bands(figures))
    console.print(Text(f"\nPage: {directory / 'image_quality.html'}"), soft_wrap=True)


def _bands(figures: Mapping[str, JSON]) -> Table:
    headings = ("band", "edges", "factor", "± σ", "MTF50 1/px", "at Nyquist", "sharpened")
    table = screen_table(*headings, right=headings)
    for row in cast(Sequence[Mapping[str, JSON]], figures["bands"]):
        numbers = [figure(cast(float | None, row[name]), 3) for name in _NUMBERS]
        table.add_row(str(row["band"]), str(row["edges"]), *numbers, "yes" if row["sharpened"] else "no")
    return table


_NUMBERS = ("factor", "sigma_factor", "mtf50", "mtf_nyquist")
