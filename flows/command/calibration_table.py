"""The result of a system calibration on the screen."""

from __future__ import annotations

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from tasks.quantities import shown
from tasks.results.calibration_figures import CalibrationFigures
from tasks.results.summary import Summary

_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "held": "dim"}
_VERDICTS = {
    "accepted": ("accepted as a calibration flight", "green"),
    "restricted": ("accepted as a calibration flight, with restrictions", "yellow"),
    "refused": ("refused as a calibration flight", "red"),
}


def calibration_table(summary: Summary, found: CalibrationFigures) -> RenderableType:
    """Verdict, and the changes with their σ and limits."""
    return Group(calibration_verdict(found), Text(), _parameters(summary, found))


def calibration_verdict(found: CalibrationFigures) -> RenderableType:
    """Whether the flight is accepted, how it was flown, and the result of the second step."""
    words, colour = _VERDICTS[found.verdict]
    verdict = Text(f"The flight is {words}.", style=f"bold {colour}")
    flown = Text(f"Flight pattern: {found.directions}; {found.heights}.")
    said = [] if found.two_step is None else [Text(found.two_step.sentence)]
    return Group(verdict, flown, *said)


def parameters_beside_limits(title: str, owner: str, value: str) -> Table:
    """An empty table of parameters with entity, value, σ, limit, unit and verdict."""
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
    )
    table.add_column("parameter", no_wrap=True)
    table.add_column(owner, overflow="fold")
    for column in (value, "± σ", "limit"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("verdict")
    return table


def _parameters(summary: Summary, found: CalibrationFigures) -> Table:
    table = parameters_beside_limits(
        "Calibrated parameters, change from the given values", "entity", "change"
    )
    changes = {(item.parameter, item.entity): item for item in summary.parameters or ()}
    held = 0
    for row in found.parameters:
        item, verdict = changes.get((row.parameter, row.entity)), row.verdict
        if item is None or verdict == "held":
            held += 1
            continue
        unit, factor, decimals = shown(item.unit or "", "screen")
        # What the flight does not determine has a σ that says why, and no value.
        change = None if verdict == "not_determinable" else item.change
        numbers = (change, row.sigma, row.limit)
        table.add_row(
            item.parameter,
            item.entity or "",
            *(written(value, factor, decimals) for value in numbers),
            unit,
            Text(verdict.replace("_", " "), style=_STYLES[verdict]),
        )
    if held:
        table.caption, table.caption_justify = f"{held} more are held at their given values", "left"
    return table


def written(value: float | None, factor: float, decimals: int) -> str:
    """A number in its unit; a dash where there is none."""
    return "–" if value is None else f"{factor * value:,.{decimals}f}"
