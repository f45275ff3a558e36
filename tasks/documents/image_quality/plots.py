"""Plots of image quality: edges over the format, responses, noise by grey level."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.chart import LEFT, RIGHT, TOP, chart
from tasks.document_kit.legend import Swatch
from tasks.documents.image_quality.material import SceneMaterial, SensorMaterial

_CLASSES = 6
_HIGHEST = 620.0
_RINGS = 20


def edge_maps(material: SceneMaterial) -> dict[int, Markup]:
    """A map for each band that has edges."""
    bands = material.edges.groupby("band")
    return {int(str(band)): _edge_map(material.size, int(str(band)), edges) for band, edges in bands}


def _edge_map(size: tuple[int, int], band: int, edges: pd.DataFrame) -> Markup:
    """Every edge at its place in the format, in its direction, coloured by its factor."""
    columns, rows = size
    unit = min((RIGHT - LEFT) / columns, _HIGHEST / rows)
    x = Scale(0.0, columns, LEFT, LEFT + columns * unit)
    y = Scale(0.0, rows, TOP, TOP + rows * unit)
    limits = _limits(edges["factor"].to_numpy(np.float64))
    colours = palette.sequence(_CLASSES)
    lines = [_edge(row, x, y, colours[_class_of(row["factor"], limits)]) for _, row in edges.iterrows()]
    words = [f"{low:.2f} – {high:.2f}" for low, high in pairwise(limits)]
    entries = [Swatch(colour, text) for colour, text in zip(colours, words, strict=True)]
    return chart(
        f"Edges of band {band} over the format by their factor of effective resolution",
        x,
        y,
        ("column [px]", "row [px]"),
        [markup.group(f"edges-{band}", lines)],
        entries,
        f"factor, band {band}",
    )


def _limits(factors: Floats) -> Floats:
    """Limits of the classes: round at both ends, and everything within."""
    low, high = np.floor(20.0 * factors.min()) / 20.0, np.ceil(20.0 * factors.max()) / 20.0
    return np.linspace(low, max(high, low + 0.05), _CLASSES + 1)


def _class_of(factor: float, limits: Floats) -> int:
    return int(np.clip(np.searchsorted(limits, factor, side="right") - 1, 0, _CLASSES - 1))


def _edge(row: pd.Series, x: Scale, y: Scale, colour: str) -> Markup:
    normal = np.deg2rad(row["normal_deg"])
    at, down = x.at(row["column_px"]), y.at(row["row_px"])
    dx, dy = -7.0 * np.sin(normal), 7.0 * np.cos(normal)
    place = f"{row['image']}, band {row['band']}, edge {row['edge']}"
    words = f"{place}: {row['factor']:.3f} ± {row['sigma_factor']:.3f}"
    ends = at - dx, down - dy, at + dx, down + dy
    return markup.line(*ends, markup.title(words), stroke=colour, stroke_width=3)


def response_plot(material: SceneMaterial) -> Markup:
    """The response of every band and direction."""
    groups = [
        (f"band {band}, along {way}", part)
        for (band, way), part in material.responses.groupby(["band", "direction"])
    ]
    curves = [(words, part["frequency"].to_numpy(), part["response"].to_numpy()) for words, part in groups]
    top = max(1.05, *(float(values.max()) for _, _, values in curves))
    return _curves(
        curves,
        Scale(0.0, 1.0, LEFT, RIGHT),
        Scale(0.0, top, 300.0, TOP),
        "spatial frequency [cycles/px]; 0.5: Nyquist",
        "response",
    )


def noise_plot(material: SceneMaterial) -> Markup:
    """Noise against grey level, band by band."""
    return _by_band(material.noise, ("level", "noise"), ("grey value", "noise [grey values]"))


def transfer_plot(sensor: SensorMaterial) -> Markup:
    """Variance against signal, band by band."""
    words = ("signal [grey values]", "variance [grey values²]")
    return _by_band(sensor.transfer, ("signal", "variance"), words)


def _by_band(table: pd.DataFrame, columns: tuple[str, str], words: tuple[str, str]) -> Markup:
    """A curve for each band: one column against another, from zero on."""
    curves = []
    for band, part in table.groupby("band"):
        x, y = (part.sort_values(columns[0])[name].to_numpy() for name in columns)
        curves.append((f"band {band}", x, y))
    right = max(float(x.max()) for _, x, _ in curves)
    top = 1.1 * max(float(y.max()) for _, _, y in curves)
    return _curves(
        curves,
        Scale(0.0, 1.02 * max(right, 1.0), LEFT, RIGHT),
        Scale(0.0, max(top, 1e-6), 300.0, TOP),
        *words,
    )


def aperture_plot(sensor: SensorMaterial) -> Markup:
    """Light against the distance from the middle of the format, band by band: means of rings of cells."""
    columns, rows = (int(cast(int, sensor.figures[name])) for name in ("columns", "rows"))
    curves = []
    for band, cells in sensor.aperture.groupby("band"):
        at = [
            ((cells[name] + 0.5) / (cells[name].max() + 1) - 0.5).to_numpy(np.float64) * size
            for name, size in (("column", columns), ("row", rows))
        ]
        radius = np.hypot(*at) / (0.5 * np.hypot(columns, rows))
        ring = np.minimum((radius * _RINGS).astype(np.int64), _RINGS - 1)
        number = np.bincount(ring, minlength=_RINGS)
        known = number > 0
        light = np.bincount(ring, cells["light"].to_numpy(np.float64), minlength=_RINGS)[known]
        middle = np.bincount(ring, radius, minlength=_RINGS)[known] / number[known]
        curves.append((f"band {band}", middle, light / number[known]))
    return _curves(
        curves,
        Scale(0.0, 1.0, LEFT, RIGHT),
        Scale(0.0, max(1.05, *(float(values.max()) for _, _, values in curves)), 300.0, TOP),
        "distance from the middle / half the diagonal",
        "light / light in the middle",
    )


def _curves(
    curves: Sequence[tuple[str, Floats, Floats]], x: Scale, y: Scale, along: str, upwards: str
) -> Markup:
    coloured = [(palette.category(k), *curve) for k, curve in enumerate(curves)]
    drawn = (markup.curve(x.of(at), y.of(values), colour) for colour, _, at, values in coloured)
    entries = [Swatch(colour, words) for colour, words, _, _ in coloured]
    return chart(f"{upwards} against {along}", x, y, (along, upwards), drawn, entries)
