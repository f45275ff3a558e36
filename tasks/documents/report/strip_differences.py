"""Boresight and offset of each strip from the two-step calibration, as a plot."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches

_MDEG = 1e3
_MOST_STRIP_NAMES = 45
# Components of a panel, label of its axis, factor of the values of the table.
_ANGLES = (("roll", "pitch", "yaw"), "misalignment [mdeg]", _MDEG)
_IN_MAP = (("east", "north", "up"), "shift in the map [m]", 1.0)
_IN_BODY = (("forward", "right", "down"), "offset in the aircraft [m]", 1.0)


def strip_plot(means: pd.DataFrame) -> Markup | None:
    """Means of the strips with their σ, three panels one below the other; None without two steps.

    Parameters
    ----------
    means : orientation_difference_means.parquet, or an empty table.
    """
    strips = means[means["scope"] == "strip"] if not means.empty else means
    if strips.empty:
        return None
    strips = strips.assign(label=strips["camera"] + " " + strips["group"])
    order = strips.drop_duplicates("label").sort_values(["camera", "group"])["label"].tolist()
    left, right = 78.0, axes.WIDTH - 12.0
    x = Scale(-0.7, len(order) - 0.3, left, right)
    parts: list[Markup] = []
    top = 14.0
    for names, label, factor in (_ANGLES, _IN_MAP, _IN_BODY):
        panel, top = _panel(strips, order, x, top, names, label, factor)
        parts += panel
    if len(order) <= _MOST_STRIP_NAMES:
        parts += _names(order, x, top)
        top += 62.0
    return markup.svg(axes.WIDTH, top + 8, "Misalignment and offset of each strip", *parts)


def _panel(
    strips: pd.DataFrame,
    order: list[str],
    x: Scale,
    top: float,
    names: tuple[str, ...],
    label: str,
    factor: float,
) -> tuple[list[Markup], float]:
    """One panel with three components side by side; and where the next one begins."""
    bottom = top + 150.0
    own = {name: strips[strips["component"] == name].set_index("label").reindex(order) for name in names}
    values = np.concatenate([table["value"].to_numpy(np.float64) * factor for table in own.values()])
    sigmas = np.concatenate([table["sigma"].to_numpy(np.float64) * factor for table in own.values()])
    reach = np.nan_to_num(sigmas)
    low, high = float(np.nanmin(values - reach)), float(np.nanmax(values + reach))
    margin = 0.06 * max(high - low, 1e-9)
    y = Scale(min(low - margin, 0.0), max(high + margin, 0.0), bottom, top)
    parts = [axes.vertical_axis(y, x.start, x.end, label)]
    for index, name in enumerate(names):
        parts.append(_marks(own[name], factor, x, y, 0.18 * (index - 1), palette.category(index)))
    parts.append(axes.frame(x.start, top, x.end, bottom))
    items = [Swatch(palette.category(index), name) for index, name in enumerate(names)]
    legend, following = swatches(x.start, bottom + 6, "", items, x.end - x.start)
    return [*parts, legend], following + 10


def _marks(table: pd.DataFrame, factor: float, x: Scale, y: Scale, aside: float, colour: str) -> Markup:
    """A dot for each strip, with a line of one σ up and down."""
    value: Floats = table["value"].to_numpy(np.float64) * factor
    sigma: Floats = np.nan_to_num(table["sigma"].to_numpy(np.float64) * factor)
    parts = []
    for number, (label, mean, spread) in enumerate(zip(table.index, value, sigma, strict=True)):
        if not np.isfinite(mean):
            continue
        place = x.at(number + aside)
        words = markup.title(f"{label}: {mean:.3g} ± {spread:.2g}")
        parts += [
            markup.line(place, y.at(mean - spread), place, y.at(mean + spread), stroke=colour),
            markup.circle(place, y.at(mean), 2.6, words, fill=colour),
        ]
    return markup.group("", parts)


def _names(order: list[str], x: Scale, top: float) -> list[Markup]:
    """Names of the strips, turned to stand side by side; one camera's name is not repeated."""
    cameras = {label.split(" ", 1)[0] for label in order}
    parts = []
    for number, label in enumerate(order):
        words = label.split(" ", 1)[1] if len(cameras) == 1 else label
        parts.append(markup.turned_text(x.at(number) + 4, top, words, "end"))
    return parts
