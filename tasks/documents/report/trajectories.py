"""The map of the trajectories that the exposures were taken from: solutions, gaps, outliers, events."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.legend import Swatch
from tasks.document_kit.map_plot import MapPlot

_PLAIN, _FIXED, _OTHER, _OUTLIER = palette.FAINT, "#009E73", "#E69F00", "#C1351B"
# Above this many exposures single names would take too much room.
_MOST_NAMED = 3_000


def trajectory_map(trajectories: pd.DataFrame, exposures: pd.DataFrame) -> Markup | None:
    """The map with its legend; None without a trajectory.

    Parameters
    ----------
    trajectories, exposures : the tables of these names; the first may be empty.
    """
    if trajectories.empty:
        return None
    events = exposures[exposures["x_m"].notna()]
    plot = MapPlot.over(
        np.concatenate([trajectories["x_m"], events["x_m"]]),
        np.concatenate([trajectories["y_m"], events["y_m"]]),
    )
    parts = [plot.axes()]
    for _, own in trajectories.groupby("trajectory", sort=True):
        parts += _lines(own, plot)
    parts.append(_dots(events, plot))
    outliers = trajectories.loc[trajectories["is_outlier"], ["x_m", "y_m", "time_s"]]
    circles = [
        markup.circle(plot.x.at(x), plot.y.at(y), 6, markup.title(words), fill="none", stroke=_OUTLIER)
        for x, y, time in outliers.itertuples(index=False)
        for words in (f"sample at {time:.3f} s inconsistent with its neighbours",)
    ]
    parts.append(markup.group("outliers", circles))
    legend, bottom = plot.legend("trajectory", _entries(trajectories))
    return markup.svg(axes.WIDTH, bottom + 8, "Map of the trajectories", *parts, legend)


def _entries(trajectories: pd.DataFrame) -> list[Swatch]:
    """Entries of its legend."""
    solution = trajectories["solution"]
    shown = (
        (_PLAIN, "without quality", solution.isna().any()),
        (_FIXED, "fixed solution", (solution == "fixed").any()),
        (_OTHER, "other solution", (solution.notna() & (solution != "fixed")).any()),
        (palette.INK, "exposure", True),
        (_OUTLIER, "outlier (circle), gap (dashed)", True),
    )
    return [Swatch(colour, words) for colour, words, is_there in shown if is_there]


def _lines(own: pd.DataFrame, plot: MapPlot) -> Iterator[Markup]:
    """A line for each run of samples of one kind, dashed over gaps."""
    x, y = plot.x.of(own["x_m"].to_numpy(np.float64)), plot.y.of(own["y_m"].to_numpy(np.float64))
    colours = [_colour(solution) for solution in own["solution"]]
    gaps = own["after_gap"].to_numpy(bool)
    start = 0
    for row in range(1, len(own) + 1):
        if row < len(own) and not gaps[row] and colours[row] == colours[start]:
            continue
        yield _line(x[start:row], y[start:row], colours[start])
        if row < len(own):
            yield _line(
                x[row - 1 : row + 1], y[row - 1 : row + 1], _OUTLIER if gaps[row] else colours[row], gaps[row]
            )
        start = row


def _colour(solution: object) -> str:
    if not isinstance(solution, str):
        return _PLAIN
    return _FIXED if solution == "fixed" else _OTHER


def _line(x: Floats, y: Floats, colour: str, is_gap: bool = False) -> Markup:
    if len(x) < 2:
        return Markup("")
    return markup.curve(x, y, colour, stroke_dasharray="4 3") if is_gap else markup.curve(x, y, colour)


def _dots(events: pd.DataFrame, plot: MapPlot) -> Markup:
    """A dot at each exposure, with its name unless there are too many."""
    named = len(events) <= _MOST_NAMED
    dots = [
        markup.circle(plot.x.at(x), plot.y.at(y), 2.2, *words, fill=palette.INK)
        for image, x, y in events[["image", "x_m", "y_m"]].itertuples(index=False)
        for words in ([markup.title(str(image))] if named else [],)
    ]
    return markup.group("events", dots)
