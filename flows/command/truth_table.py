"""Carry out ``aerocal flight-check`` and show estimates next to the truth."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.calibration_table import calibration_verdict
from flows.command.exit_code import DONE, GATE_FAILED, OF_STATUS, complain
from flows.command.georeferencing_table import CHECK_PAGE, georeferencing_table
from flows.command.progress import show_progress
from flows.command.result_table import pages_of
from flows.command.screen_table import print_listed, screen, screen_table
from flows.runs.project_run import RunOutcome
from flows.stories.flight_check import flight_check
from tasks.quantities import COMPONENTS, Shown, shown
from tasks.results.figures import figures_of
from tasks.results.summary import Summary
from tasks.settings.load_simulation import load_simulation
from tasks.settings.simulated_truth import PublishedCheck
from tasks.settings.simulation import Simulation
from tasks.simulation.truth_comparison import JointTest, RecoveredParameter, TruthComparison


def check_and_show(
    source: str, out: Path, overrides: tuple[str, ...], seed: int | None, *, calibrates: bool = False
) -> int:
    """Run the flight check; returns the exit code."""
    show_progress()
    simulation = load_simulation(source, overrides, seed)
    check = flight_check(simulation, out, calibrates=calibrates)
    if check.comparison is None:
        complain(str(check.outcome.error))
        return OF_STATUS[check.outcome.summary.status]
    return show(screen(), simulation, check.outcome, check.comparison)


def show(console: Console, simulation: Simulation, outcome: RunOutcome, comparison: TruthComparison) -> int:
    """Show what a flight check has found; returns the exit code."""
    summary = outcome.summary
    _show_size(console, summary)
    if comparison.parameters:
        console.print(_parameters(comparison, simulation.truth.source))
    if comparison.joint is not None:
        console.print(_joint(comparison.joint))
    console.print(_kinds(comparison))
    calibration = figures_of(summary.model_extra).calibration
    if calibration is not None:
        console.print(Text(), calibration_verdict(calibration))
    if summary.direct_georeferencing is not None:
        console.print(Text("\nDirect georeferencing with these values", style="bold"))
        console.print(georeferencing_table(summary.direct_georeferencing, in_brief=True))
        if simulation.truth.published is not None:
            console.print(_published(simulation.truth.published))
    return _verdict(console, comparison, outcome)


def _show_size(console: Console, summary: Summary) -> None:
    counts = summary.counts
    console.print(
        Text(
            f"\n{counts.images:,} images, {counts.object_points:,} object points, {counts.image_points:,} "
            f"image points, {counts.control} control points; σ0 {summary.sigma0:.3f}, "
            f"redundancy {summary.redundancy:,.0f}"
        )
    )


def _published(check: PublishedCheck) -> Text:
    """Published results of the same check."""
    parts = []
    if check.rmse_m is not None:
        parts.append(f"RMS {', '.join(f'{value:.3f}' for value in check.rmse_m)} m")
    if check.y_parallax_max_um is not None:
        parts.append(f"largest y-parallax {check.y_parallax_max_um:g} µm")
    return Text(f"• Published: {'; '.join(parts)}. {check.remark}")


def _parameters(comparison: TruthComparison, source: str | None) -> Table:
    table = screen_table(
        "parameter", "entity", "true", "estimated", "± σ", "unit", "error/σ",
        right=("true", "estimated", "± σ", "error/σ"), whole=("unit",), title="\nEstimates and true values",
    )  # fmt: skip
    for item in comparison.parameters:
        table.add_row(item.parameter, item.entity, *_numbers(item), f"{item.t:+z.2f}")
    if source is not None:
        table.caption = f"true = {source}"
    return table


def _numbers(item: RecoveredParameter) -> tuple[str, str, str, str]:
    """True and estimated value, σ and unit; a focal length in mm, because it is not a small change."""
    known = COMPONENTS.get(item.parameter)
    is_large = known is not None and known.kind.is_large
    unit, factor, decimals = Shown(item.unit, 1.0, 5) if is_large else shown(item.unit, "screen")
    values = (item.true, item.estimated, item.sigma)
    true, estimated, sigma = (f"{factor * value:.{decimals}f}" for value in values)
    return true, estimated, sigma, unit


def _joint(test: JointTest) -> Text:
    style = "" if test.chi_squared < test.limit else "yellow"
    return Text(
        f"All {test.freedom} parameters together: χ² = {test.chi_squared:.1f}; 99 % of flights stay below "
        f"{test.limit:.1f}.\n",
        style=style,
    )


def _kinds(comparison: TruthComparison) -> Table:
    headings = ("unknowns", "number", "true RMS error", "stated σ", "unit", "error/σ, pooled")
    table = screen_table(*headings, right=(*headings[1:4], headings[5]))
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


def _verdict(console: Console, comparison: TruthComparison, outcome: RunOutcome) -> int:
    contradictions = comparison.contradictions()
    if contradictions:
        console.print(Text("\nThe result contradicts the truth:", style="bold red"))
        print_listed(console, contradictions, "red")
    else:
        console.print(Text(f"\n{comparison.agreement()}", style="bold green"))
    checked = outcome.summary.direct_georeferencing is not None
    for line in pages_of(outcome, ("report.html", *([CHECK_PAGE] if checked else [])), certified=True):
        console.print(Text(line), soft_wrap=True)
    return GATE_FAILED if contradictions else DONE
