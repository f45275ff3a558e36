"""Carry out ``aerocal flight-check`` and show estimates beside the truth."""

from __future__ import annotations

from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE, GATE_FAILED, OF_STATUS, complain
from flows.command.progress import show_progress
from flows.flight_check import flight_check
from tasks.settings.load_simulation import load_simulation
from tasks.truth_comparison import TruthComparison


def check_and_show(source: str, out: Path, overrides: tuple[str, ...], seed: int | None) -> int:
    """Run the flight check; returns the exit code."""
    show_progress()
    check = flight_check(load_simulation(source, overrides, seed), out)
    if check.comparison is None:
        complain(str(check.outcome.error))
        return OF_STATUS[check.outcome.summary.status]
    console = Console()
    counts, summary = check.outcome.summary.counts, check.outcome.summary
    console.print(
        Text(
            f"\n{counts.images:,} images, {counts.object_points:,} object points, {counts.image_points:,} "
            f"image points, {counts.control} control points; σ0 {summary.sigma0:.3f}, "
            f"redundancy {summary.redundancy:,.0f}"
        )
    )
    if check.comparison.parameters:
        console.print(_parameters(check.comparison))
    console.print(_kinds(check.comparison))
    return _verdict(console, check.comparison, check.outcome.directory)


def _parameters(comparison: TruthComparison) -> Table:
    table = Table("parameter", "entity", box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for column in ("true", "estimated", "± σ"):
        table.add_column(column, justify="right")
    table.add_column("unit")
    table.add_column("error/σ", justify="right")
    for item in comparison.parameters:
        digits = 5 if item.unit == "deg" else 4
        table.add_row(
            item.parameter,
            item.entity,
            f"{item.true:.{digits}f}",
            f"{item.estimated:.{digits}f}",
            f"{item.sigma:.{digits}f}",
            item.unit,
            f"{item.t:+.2f}",
        )
    return table


def _kinds(comparison: TruthComparison) -> Table:
    table = Table("unknowns", box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for column in ("number", "true RMS error", "stated σ"):
        table.add_column(column, justify="right")
    table.add_column("unit")
    table.add_column("error/σ, pooled", justify="right")
    for item in comparison.kinds:
        digits = 5 if item.unit == "deg" else 4
        table.add_row(
            item.kind,
            f"{item.number:,}",
            f"{item.rmse:.{digits}f}",
            f"{item.sigma:.{digits}f}",
            item.unit,
            f"{item.pooled:.3f}",
        )
    return table


def _verdict(console: Console, comparison: TruthComparison, directory: Path) -> int:
    contradictions = comparison.contradictions()
    if contradictions:
        console.print(Text("\nThe result contradicts the truth:", style="bold red"))
        for sentence in contradictions:
            console.print(Text(f"• {sentence}", style="red"))
    else:
        console.print(Text("\nEvery estimate agrees with the truth within its own σ.", style="bold green"))
    console.print(Text(f"Report: {directory / 'report.html'}"), soft_wrap=True)
    return GATE_FAILED if contradictions else DONE
