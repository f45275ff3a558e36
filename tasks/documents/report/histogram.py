"""Standardized residuals against the normal distribution they should have."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from scipy import special

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.quantities import group_words

_LIMIT = 5.0
_BINS = 50
#: |w| beyond which residuals are counted.
LEVELS = (1.96, 2.58, 3.29, 4.13)


def standardized(material: Material, group: str) -> Floats:
    """Standardized residuals (n,) of the controlled observations of a group that were used."""
    table = material.residuals
    own = table["standardized"][(table["group"] == group) & (table["status"] == "used")]
    values: Floats = own.dropna().to_numpy(np.float64)
    return values


def histogram(values: Floats) -> tuple[Floats, int]:
    """Counts (bins,) of equal bins from −5 to 5; what lies beyond is in the outermost ones, and counted."""
    beyond = int((np.abs(values) > _LIMIT).sum())
    counts, _ = np.histogram(np.clip(values, -_LIMIT, _LIMIT), bins=_BINS, range=(-_LIMIT, _LIMIT))
    return counts.astype(np.float64), beyond


def histogram_plot(material: Material) -> Markup:
    """Bars of the image residuals with the curves N(0, 1) and N(0, s²), s the standard deviation of w."""
    values = standardized(material, IMAGE_POINTS)
    counts, beyond = histogram(values)
    width = 2.0 * _LIMIT / _BINS
    spread = float(np.sqrt(np.mean(values**2))) if len(values) else 1.0
    at = np.linspace(-_LIMIT, _LIMIT, 201)
    curves = [
        len(values) * width * np.exp(-0.5 * (at / s) ** 2) / (s * np.sqrt(2 * np.pi)) for s in (1.0, spread)
    ]
    top, bottom, left, right = 10.0, 290.0, 78.0, axes.WIDTH - 12.0
    x = Scale(-_LIMIT, _LIMIT, left, right)
    y = Scale(0.0, 1.06 * max(1.0, float(counts.max()), *(float(c.max()) for c in curves)), bottom, top)
    bars = "".join(
        f"M{markup.number(x.at(-_LIMIT + i * width))},{markup.number(bottom)}"
        f"V{markup.number(y.at(count))}h{markup.number(width * x.unit - 1)}V{markup.number(bottom)}z"
        for i, count in enumerate(counts)
        if count > 0
    )
    bar, normal, own = "#b5d6e5", palette.INK, palette.ACCENT
    legend, end = swatches(
        left,
        bottom + 48,
        "image coordinates",
        [
            Swatch(bar, f"{len(values):,} standardized residuals"),
            Swatch(normal, "normal curve, σ = 1"),
            Swatch(own, f"normal curve, σ = {spread:.2f}"),
        ],
        right - left,
    )
    drawn = [
        axes.horizontal_axis(
            x, top, bottom, "standardized residual w (outermost bars: all larger values)", about=10
        ),
        axes.vertical_axis(y, left, right, "number in a bar"),
        markup.element("path", {"fill": bar, "d": bars}, markup.title(f"{beyond:,} beyond ±{_LIMIT:g}")),
        *(
            markup.element(
                "path", {"class": "curve", "stroke": colour, "d": markup.path_of(x.of(at), y.of(curve))}
            )
            for colour, curve in ((normal, curves[0]), (own, curves[1]))
        ),
        axes.frame(left, top, right, bottom),
        legend,
    ]
    return markup.svg(axes.WIDTH, end + 4, "Histogram of standardized residuals", *drawn)


def standardized_table(material: Material) -> Table:
    """For each group: number, mean, root mean square, largest |w|, and the share beyond some levels."""
    columns = (
        text_column("group", "group"),
        Column("count", "tested"),
        Column("mean", "mean w"),
        Column("rms", "RMS w"),
        Column("largest", "largest |w|"),
        *(Column(f"beyond_{level}", f"|w| > {level}", "%") for level in LEVELS),
    )
    rows = []
    for name in material.residuals["group"].unique():
        values = standardized(material, str(name))
        size = np.abs(values)
        if len(values) == 0:
            continue
        figures = [float(values.mean()), float(np.sqrt(np.mean(values**2))), float(size.max())]
        shares = [100.0 * float((size > level).mean()) for level in LEVELS]
        cells = (*numbers((float(len(values)),), 0), *numbers(figures, 2), *numbers(shares, 2))
        rows.append(Row(str(name), (group_words(str(name)), *cells)))
    expected = [100.0 * float(special.erfc(level / np.sqrt(2.0))) for level in LEVELS]
    nothing = numbers((None, 0.0, 1.0, None), 0)
    rows.append(Row("expected", ("normal distribution", *nothing, *numbers(expected, 3))))
    return Table("standardized-residuals", "Standardized residuals by group", columns, tuple(rows))
