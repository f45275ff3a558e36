"""The result of a two-step calibration by itself on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from rich.console import Group, RenderableType
from rich.text import Text

from flows.command.calibration_table import parameters_beside_limits
from tasks.storage.json_text import JSON
from tasks.summary import Summary

#: Figure of a two-step calibration by itself in summary.json.
TWO_STEP_ONLY = "two_step_calibration"
_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "not_called_for": "dim"}
# Factor from the unit of the figures, unit, and decimals in which a parameter is shown.
_SHOWN = {"deg": (1e3, "mdeg", 3), "m": (1e2, "cm", 2)}
_VERDICTS = {
    "accepted": ("accepted", "green"),
    "restricted": ("accepted with restrictions", "yellow"),
    "refused": ("refused", "red"),
}


def two_step_only(summary: Summary) -> Mapping[str, JSON] | None:
    """The figures of a two-step calibration by itself; None if the run made none."""
    found = (summary.model_extra or {}).get(TWO_STEP_ONLY)
    return cast("Mapping[str, JSON]", found) if isinstance(found, Mapping) else None


def two_step_table(found: Mapping[str, JSON]) -> RenderableType:
    """Verdict, and the parameters with their σ and limits."""
    words, colour = _VERDICTS[str(found["verdict"])]
    table = parameters_beside_limits("Parameters by the second step", "camera", "value")
    for row in cast("Sequence[Mapping[str, JSON]]", found["parameters"]):
        factor, unit, decimals = _SHOWN[str(row["unit"])]
        verdict = str(row["verdict"])
        numbers = (row["value"], row["sigma"], row["limit"])
        table.add_row(
            str(row["parameter"]),
            str(row["camera"]),
            *(_number(value, factor, decimals) for value in numbers),
            unit,
            Text(verdict.replace("_", " "), style=_STYLES[verdict]),
        )
    sentence = Text(f"The two-step calibration is {words}.", style=f"bold {colour}")
    return Group(sentence, Text(), table)


def _number(value: JSON, factor: float, decimals: int) -> str:
    return f"{factor * float(value):,.{decimals}f}" if isinstance(value, int | float) else "–"
