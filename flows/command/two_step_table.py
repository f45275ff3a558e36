"""The result of a two-step calibration by itself on the screen."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from flows.command.calibration_table import parameters_beside_limits, written
from tasks.quantities import shown
from tasks.results.calibration_figures import TwoStepVerdictFigure

_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "not_called_for": "dim"}
_VERDICTS = {
    "accepted": ("accepted", "green"),
    "restricted": ("accepted with restrictions", "yellow"),
    "refused": ("refused", "red"),
}


def two_step_table(found: TwoStepVerdictFigure) -> RenderableType:
    """Verdict, and the parameters with their σ and limits."""
    words, colour = _VERDICTS[found.verdict]
    table = parameters_beside_limits("Parameters from the second step", "camera", "value")
    for row in found.parameters:
        unit, factor, decimals = shown(row.unit, "screen")
        numbers = (row.value, row.sigma, row.limit)
        table.add_row(
            row.parameter,
            row.camera,
            *(written(value, factor, decimals) for value in numbers),
            unit,
            Text(row.verdict.replace("_", " "), style=_STYLES[row.verdict]),
        )
    sentence = Text(f"The two-step calibration is {words}.", style=f"bold {colour}")
    return Group(sentence, Text(), table)
