"""The result of a direct-georeferencing check on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tasks.storage.json_text import JSON
from tasks.summary import DirectGeoreferencing

#: The page of a check in the output folder.
CHECK_PAGE = "georeferencing_check.html"
# Figure, words, decimals.
_ROWS = (
    ("points", "points", 0),
    ("rmse_m", "RMS", 3),
    ("predicted_rmse_m", "predicted RMS", 3),
    ("predicted_low_m", "  from (95 %)", 3),
    ("predicted_high_m", "  to (95 %)", 3),
    ("mean_m", "mean", 3),
    ("max_m", "largest |d|", 3),
    ("rmse_gsd", "RMS in GSD", 2),
)
_SETS = (
    ("", "Independent check points, all rays [m]"),
    ("in_models", "Independent check points, two rays of a model [m]"),
    ("at_control_of_calibration", "Control of the calibration: no accuracy [m]"),
)


def georeferencing_table(found: DirectGeoreferencing, *, in_brief: bool = False) -> RenderableType:
    """Differences east, north, up beside their prediction, y-parallaxes, and what standards let say.

    Parameters
    ----------
    in_brief : without the points of single models.
    """
    figures = cast(Mapping[str, JSON], found.model_dump())
    parts: list[RenderableType] = []
    for name, title in _SETS:
        if in_brief and name == "in_models":
            continue
        table = _differences(figures if not name else _table(figures[name]))
        if table.row_count:
            parts += [Text(title, style="bold"), Padding(table, (0, 0, 1, 0))]
    if figures.get("y_parallaxes"):
        count, models = figures["y_parallaxes"], figures["y_parallax_models"]
        title = f"y-parallaxes of {count:,} points in {models:,} models [µm]"
        parts += [Text(title, style="bold"), _parallaxes(figures)]
    sentences = [str(_table(item)["sentence"]) for item in cast(Sequence[JSON], figures["statements"])]
    parts.append(Padding(Group(*(Text(f"• {sentence}") for sentence in sentences)), (1, 0, 0, 0)))
    return Group(*parts)


def _table(value: JSON) -> Mapping[str, JSON]:
    return cast(Mapping[str, JSON], value)


def _differences(figures: Mapping[str, JSON]) -> Table:
    table = _empty()
    table.add_column("")
    for way in ("east", "north", "up"):
        table.add_column(way, justify="right", no_wrap=True)
    for name, words, decimals in _ROWS:
        values = cast(Sequence[JSON], figures.get(name) or (None, None, None))
        if any(values):
            table.add_row(words, *(_number(value, decimals) for value in values))
    return table


def _parallaxes(figures: Mapping[str, JSON]) -> Table:
    table = _empty()
    for column in ("", "found", "predicted", "from", "to (95 %)"):
        table.add_column(column, justify="left" if not column else "right", no_wrap=True)
    for words, names in (
        ("RMS", ("rms", "predicted_rms", "predicted_low", "predicted_high")),
        ("largest", ("max", "predicted_max", "", "predicted_max_limit")),
    ):
        values = [figures.get(f"y_parallax_{name}_um") if name else None for name in names]
        table.add_row(words, *(_number(value, 1) for value in values))
    return table


def _empty() -> Table:
    """A table with a rule under its head and no frame."""
    return Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)


def _number(value: JSON, decimals: int) -> str:
    return f"{value:,.{decimals}f}" if isinstance(value, int | float) else "–"
