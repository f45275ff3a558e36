"""Standardized residuals against the normal distribution they should have."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from scipy import special

from adjust.arrays import Floats
from tasks.document_kit import markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.chart import BAR, LEFT, RIGHT, TOP, bars, chart
from tasks.document_kit.legend import Swatch
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.quantities import group_words

_LIMIT = 5.0
_BINS = 50
#: |w| beyond which residuals are counted.
LEVELS = (1.96, 2.58, 3.29, 4.13)


def histogram(values: Floats) -> tuple[Floats, int]:
    """Counts (bins,) of equal bins from −5 to 5; what lies beyond is in the outermost ones, and counted."""
    beyond = int((np.abs(values) > _LIMIT).sum())
    counts, _ = np.histogram(np.clip(values, -_LIMIT, _LIMIT), bins=_BINS, range=(-_LIMIT, _LIMIT))
    return counts.astype(np.float64), beyond


def histogram_plot(material: Material) -> Markup:
    """Bars of the image residuals with the curves N(0, 1) and N(0, s²), s the standard deviation of w."""
    values = material.standardized[IMAGE_POINTS]
    counts, beyond = histogram(values)
    width = 2.0 * _LIMIT / _BINS
    spread = float(np.sqrt(np.mean(values**2))) if len(values) else 1.0
    at = np.linspace(-_LIMIT, _LIMIT, 201)
    curves = [
        len(values) * width * np.exp(-0.5 * (at / s) ** 2) / (s * np.sqrt(2 * np.pi)) for s in (1.0, spread)
    ]
    x = Scale(-_LIMIT, _LIMIT, LEFT, RIGHT)
    y = Scale(0.0, 1.06 * max(1.0, float(counts.max()), *(float(c.max()) for c in curves)), 290.0, TOP)
    colours = (palette.INK, palette.ACCENT)
    beyond_words = markup.title(f"{beyond:,} beyond ±{_LIMIT:g}")
    return chart(
        "Histogram of standardized residuals",
        x,
        y,
        ("standardized residual w (outermost bars: all larger values)", "number in a bar"),
        (
            bars(x, y, np.linspace(-_LIMIT, _LIMIT, _BINS + 1), counts, beyond_words),
            *(markup.curve(x.of(at), y.of(own), c) for c, own in zip(colours, curves, strict=True)),
        ),
        [
            Swatch(BAR, f"{len(values):,} standardized residuals"),
            Swatch(colours[0], "normal curve, σ = 1"),
            Swatch(colours[1], f"normal curve, σ = {spread:.2f}"),
        ],
        "image coordinates",
        about=10,
    )


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
    for name, values in material.standardized.items():
        size = np.abs(values)
        if len(values) == 0:
            continue
        figures = [float(values.mean()), float(np.sqrt(np.mean(values**2))), float(size.max())]
        shares = [100.0 * float((size > level).mean()) for level in LEVELS]
        cells = (*numbers((float(len(values)),), 0), *numbers(figures, 2), *numbers(shares, 2))
        rows.append(Row(name, (group_words(name), *cells)))
    expected = [100.0 * float(special.erfc(level / np.sqrt(2.0))) for level in LEVELS]
    nothing = numbers((None, 0.0, 1.0, None), 0)
    rows.append(Row("expected", ("normal distribution", *nothing, *numbers(expected, 3))))
    return Table("standardized-residuals", "Standardized residuals by group", columns, tuple(rows))
