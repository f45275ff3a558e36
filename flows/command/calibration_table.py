"""The result of a system calibration on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from tasks.storage.json_text import JSON
from tasks.summary import Summary

#: Figure of a system calibration in summary.json.
CALIBRATION = "calibration"
_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "held": "dim"}
# Factor from the unit of the tables, unit, and decimals in which a parameter is shown.
_SHOWN = {"mm": (1e3, "µm", 2), "deg": (1e3, "mdeg", 3), "m": (1e2, "cm", 2), "s": (1e3, "ms", 3)}

_VERDICTS = {
    "accepted": ("accepted as a calibration flight", "green"),
    "restricted": ("accepted as a calibration flight, with restrictions", "yellow"),
    "refused": ("refused as a calibration flight", "red"),
}


def calibration_of(summary: Summary) -> Mapping[str, JSON] | None:
    """The figures of a system calibration; None if the run made none."""
    found = (summary.model_extra or {}).get(CALIBRATION)
    return cast("Mapping[str, JSON]", found) if isinstance(found, Mapping) else None


def calibration_table(summary: Summary, found: Mapping[str, JSON]) -> RenderableType:
    """Verdict, and the changes with their σ and limits."""
    return Group(calibration_verdict(found), Text(), _parameters(summary, found))


def calibration_verdict(found: Mapping[str, JSON]) -> RenderableType:
    """Whether the flight is accepted, how it was flown, and what the second step says."""
    words, colour = _VERDICTS[str(found["verdict"])]
    verdict = Text(f"The flight is {words}.", style=f"bold {colour}")
    flown = Text(f"Flown: {found['directions']}; {found['heights']}.")
    steps = found.get("two_step")
    said = [Text(str(steps["sentence"]))] if isinstance(steps, Mapping) else []
    return Group(verdict, flown, *said)


def parameters_beside_limits(title: str, owner: str, value: str) -> Table:
    """An empty table of parameters: whose they are, value, σ, limit, unit, verdict."""
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


def _parameters(summary: Summary, found: Mapping[str, JSON]) -> Table:
    table = parameters_beside_limits(
        "Calibrated parameters, change against the given values", "entity", "change"
    )
    changes = {(item.parameter, item.entity): item for item in summary.parameters or ()}
    held = 0
    for row in cast("Sequence[Mapping[str, JSON]]", found["parameters"]):
        item = changes.get((str(row["parameter"]), str(row["entity"])))
        verdict = str(row["verdict"])
        if item is None or verdict == "held":
            held += 1
            continue
        factor, unit, decimals = _SHOWN.get(item.unit or "", (1.0, item.unit or "", 6))
        # What the flight does not determine has a σ that says why, and no value.
        change = None if verdict == "not_determinable" else item.change
        numbers = (change, row["sigma"], row["limit"])
        table.add_row(
            item.parameter,
            item.entity or "",
            *(_number(value, factor, decimals) for value in numbers),
            unit,
            Text(verdict.replace("_", " "), style=_STYLES[verdict]),
        )
    if held:
        table.caption, table.caption_justify = f"{held} more are held at their given values", "left"
    return table


def _number(value: JSON, factor: float, decimals: int) -> str:
    return f"{factor * float(value):,.{decimals}f}" if isinstance(value, int | float) else "–"
