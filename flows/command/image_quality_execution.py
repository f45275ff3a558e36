"""Carry out ``aerocal image-quality`` and show the factors of the bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import OF_STATUS
from flows.command.living_line import living_line
from flows.command.progress import show_progress
from flows.stories.image_quality import image_quality, stages_of
from tasks.errors import InputError
from tasks.files.installation import writing_into
from tasks.files.json_text import JSON, json_text
from tasks.results.summary import Summary, failed_summary, write_summary
from tasks.settings.load_image_quality import load_image_quality
from tasks.store.run_lock import run_lock
from tasks.store.store import Store


def execute_image_quality(
    source: Path, out: Path | None, overrides: tuple[str, ...], data: Path | None, *, as_json: bool
) -> int:
    """Run, and show the result; returns the exit code. Wrong input leaves as an InputError."""
    console = show_progress()
    wanted = load_image_quality(source, overrides, data)
    directory = source.parent / "image-quality" if out is None else out
    store = Store.of(directory)
    with run_lock(directory):
        store.begin_run()
        try:
            with living_line(console, directory, stages_of(wanted)):
                summary = image_quality(wanted, store)
        except InputError as error:
            with writing_into(directory):
                write_summary(directory, failed_summary("input_error", str(error), {}))
            raise
    if as_json:
        print(json_text(summary.to_json(), indent=2))
    else:
        _show(summary, directory)
    return OF_STATUS[summary.status]


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
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for column in ("band", "edges", "factor", "± σ", "MTF50 1/px", "at Nyquist", "sharpened"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in cast(Sequence[Mapping[str, JSON]], figures["bands"]):
        numbers = [f"{cast(float, row[name]):.3f}" if row[name] is not None else "–" for name in _NUMBERS]
        table.add_row(str(row["band"]), str(row["edges"]), *numbers, "yes" if row["sharpened"] else "no")
    return table


_NUMBERS = ("factor", "sigma_factor", "mtf50", "mtf_nyquist")
