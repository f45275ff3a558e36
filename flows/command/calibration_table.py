"""The result of a system calibration on the screen."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from flows.command.screen_table import figure, screen_table
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
    steps = found.two_step
    # A contradiction is among the problems.
    said = [] if steps is None or steps.sentence in found.reasons else [Text(steps.sentence)]
    return Group(verdict, flown, *said)


def parameters_beside_limits(title: str, owner: str, value: str) -> Table:
    """An empty table of parameters with entity, value, σ, limit, unit and verdict."""
    headings = ("parameter", owner, value, "± σ", "limit", "unit", "verdict")
    return screen_table(*headings, right=headings[2:5], whole=("parameter", "unit"), title=title)


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
        table.caption = f"{held} more are held at their given values"
    return table


def written(value: float | None, factor: float, decimals: int) -> str:
    """A number in its unit; a dash where there is none."""
    return figure(None if value is None else factor * value, decimals)
