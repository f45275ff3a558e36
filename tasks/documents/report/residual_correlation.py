"""Correlation of neighbouring residuals: what the model does not explain; corrections by mean residuals."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches
from tasks.document_kit.table import Column, Row, Table, numbers
from tasks.documents.report.material import Material
from tasks.results.figures import GridIterationFigure

_TOP, _BOTTOM, _LEFT = 10.0, 250.0, 78.0
# Fewer pairs scatter too much to be drawn.
_LEAST_PAIRS = 30


def correlation_plot(material: Material) -> Markup | None:
    """ρ over the logarithm of the distance, a line for each camera and coordinate; None without pairs."""
    table = material.residual_autocorrelation
    table = table[(table["pairs"] >= _LEAST_PAIRS) & table["correlation"].notna()]
    if len(table) == 0:
        return None
    right = axes.WIDTH - 12.0
    # Classes double from one to the next: the logarithm spaces them evenly.
    place = np.log2(table["distance_to_mm"].to_numpy(np.float64))
    values = table["correlation"].to_numpy(np.float64)
    x = Scale(float(place.min()) - 0.5, float(place.max()) + 0.5, _LEFT, right)
    y = Scale(min(-0.1, 1.1 * float(values.min())), max(0.2, 1.1 * float(values.max())), _BOTTOM, _TOP)
    drawn: list[Markup] = [_distance_axis(x, table), axes.vertical_axis(y, _LEFT, right, "correlation ρ")]
    entries = []
    for index, (key, own) in enumerate(table.groupby(["camera", "component"], sort=True)):
        camera, component = (str(part) for part in key)
        colour = palette.category(index)
        drawn.append(_line(own, x, y, colour))
        entries.append(Swatch(colour, f"{camera}, {component}"))
    legend, end = swatches(_LEFT, _BOTTOM + 48, "coordinates", entries, right - _LEFT)
    frame = axes.frame(_LEFT, _TOP, right, _BOTTOM)
    return markup.svg(axes.WIDTH, end + 4, "Correlation of residuals by distance", *drawn, frame, legend)


def _distance_axis(x: Scale, table: pd.DataFrame) -> Markup:
    """One tick for each class of distance."""
    classes = table[["distance_from_mm", "distance_to_mm"]].drop_duplicates().sort_values("distance_to_mm")
    places: Floats = np.log2(classes["distance_to_mm"].to_numpy(np.float64))
    parts = []
    for place, (low, high) in zip(places, classes.itertuples(index=False), strict=True):
        at = x.at(float(place))
        parts += [
            markup.line(at, _TOP, at, _BOTTOM + 4),
            markup.text(at, _BOTTOM + 17, f"{float(str(low)):g} to {float(str(high)):g}"),
        ]
    words = "distance of two image points of the same image [mm]"
    parts.append(markup.text(0.5 * (x.start + x.end), _BOTTOM + 36, words, css_class="label"))
    return markup.group("axis", parts)


def _line(own: pd.DataFrame, x: Scale, y: Scale, colour: str) -> Markup:
    """The line of one coordinate; filled marks where the correlation is beyond its limit."""
    own = own.sort_values("distance_to_mm")
    across = x.of(np.log2(own["distance_to_mm"].to_numpy(np.float64)))
    up = y.of(own["correlation"].to_numpy(np.float64))
    marks = [
        markup.circle(
            float(a),
            float(b),
            4.0,
            markup.title(f"ρ = {value:.3f}, {pairs:,} pairs"),
            stroke=colour,
            fill=colour if beyond else "#fff",
        )
        for a, b, beyond, value, pairs in zip(
            across, up, own["correlated"], own["correlation"], own["pairs"], strict=True
        )
    ]
    return markup.group("line", [markup.curve(across, up, colour), *marks])


def iteration_table(iteration: GridIterationFigure) -> Table:
    """One row for each number of corrections; the last one may have been refused."""
    columns = (
        Column("number", "corrections"),
        Column("sigma0", "σ0"),
        Column("rms_um", "RMS of the means", "µm"),
        Column("noise_um", "by chance", "µm"),
        Column("other_rms_um", "RMS of the means, images left out", "µm"),
    )
    taken = {step.number: step for step in iteration.steps}
    tried = {step.number: step for step in iteration.cross_validation}
    rows = []
    for number in sorted({*taken, *tried}):
        step, other = taken.get(number), tried.get(number)
        own = (None, None, None) if step is None else (step.sigma0, step.rms_um, step.noise_um)
        mean_rms = None if other is None else other.mean_rms_um
        rows.append(Row(str(number), (*numbers((float(number),), 0), *numbers((*own, mean_rms), 3))))
    note = f"No further correction: {iteration.stopped_because}."
    way = "collocation of mean residuals" if iteration.method == "collocation" else "mean residuals"
    return Table("grid-iteration", f"Corrections by {way}", columns, tuple(rows), note)
