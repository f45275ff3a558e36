"""The result of a direct-georeferencing check on the screen."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from flows.command.screen_table import figure, screen_table
from tasks.documents.georeferencing.check_figures import CheckFigures, DifferenceFigures, Triple
from tasks.results.summary import DirectGeoreferencing

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
    ("at_control_of_calibration", "Control points (not independent) [m]"),
)


def georeferencing_table(found: DirectGeoreferencing, *, in_brief: bool = False) -> RenderableType:
    """Differences east, north, up next to their prediction, y-parallaxes, and statements by standards.

    Parameters
    ----------
    in_brief : without the points of single models.
    """
    figures = CheckFigures.model_validate(found.model_dump())
    parts: list[RenderableType] = []
    for name, title in _SETS:
        if in_brief and name == "in_models":
            continue
        table = _differences(getattr(figures, name) if name else figures)
        if table.row_count:
            parts += [Text(title, style="bold"), Padding(table, (0, 0, 1, 0))]
    if figures.y_parallaxes:
        title = (
            f"y-parallaxes of {figures.y_parallaxes:,} points in {figures.y_parallax_models:,} models [µm]"
        )
        parts += [Text(title, style="bold"), _parallaxes(figures)]
    said = (Text(f"• {item.sentence}") for item in figures.statements)
    parts.append(Padding(Group(*said), (1, 0, 0, 0)))
    return Group(*parts)


def _differences(figures: DifferenceFigures) -> Table:
    ways = ("east", "north", "up")
    table = screen_table("", *ways, right=ways)
    for name, words, decimals in _ROWS:
        values: Triple = getattr(figures, name)
        if any(values):
            table.add_row(words, *(figure(value, decimals) for value in values))
    return table


def _parallaxes(figures: CheckFigures) -> Table:
    numbers = ("found", "predicted", "from", "to (95 %)")
    table = screen_table("", *numbers, right=numbers)
    for words, names in (
        ("RMS", ("rms", "predicted_rms", "predicted_low", "predicted_high")),
        ("largest", ("max", "predicted_max", "", "predicted_max_limit")),
    ):
        values = [getattr(figures, f"y_parallax_{name}_um") if name else None for name in names]
        table.add_row(words, *(figure(value, 1) for value in values))
    return table
