"""The trust map: how accurately new points can be measured over the ground, drawn and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.chart import BAR, LEFT, RIGHT, TOP, bars, chart
from tasks.document_kit.legend import Swatch
from tasks.document_kit.raster import Raster
from tasks.document_kit.table import Column, Row, Table, components, numbers, text_column
from tasks.documents.report.key_figures import gate_table
from tasks.documents.report.material import Material
from tasks.documents.report.point_precision import sigma_map
from tasks.results.figures import TrustMapGrid

_CELLS = 100
_BINS = 50
_BAR = "#b5d6e5"
_AXES = ("x", "y", "z")
_HEADINGS = ("east", "north", "height")
#: Rows of the table: pattern of the columns, words.
_ROWS = (
    ("sigma_{}_m", "σ, measured in all images"),
    ("pair_sigma_{}_m", "σ, measured in the best pair"),
    ("relative_sigma_{}_m", "σ relative to the next cell"),
    ("external_{}_m", "effect of an undetected error of a new image coordinate"),
    ("block_error_{}_m", "effect of an undetected error of an orientation or a control point"),
    ("ray_error_{}_m", "effect of an undetected error of an image point of the block"),
)


def trust_map_table(material: Material) -> Table:
    """Median, value at the share of the area, and largest value of everything the map shows."""
    table, figure = material.trust_map, material.figures.trust_map
    share = 0.95 if figure is None else figure.share
    grid = material.figures.trust_map_grid
    unmapped = 0 if grid is None else grid.unmapped
    rows = []
    for pattern, words in _ROWS:
        names = [pattern.format(axis) for axis in _AXES]
        if table.empty or not set(names) <= set(table):
            continue
        values = table[names].to_numpy(np.float64)
        values = values[np.isfinite(values).all(axis=1)]
        if len(values):
            rows.append(_row(pattern, words, values, share, unmapped))
    columns = (
        text_column("quantity", "quantity"),
        Column("cells", "cells"),
        *components("median_{}_m", [f"median {h}" for h in _HEADINGS], "m", _AXES),
        *components("share_{}_m", [f"{share:.0%} of cells {h}" for h in _HEADINGS], "m", _AXES),
        *components("max_{}_m", [f"largest {h}" for h in _HEADINGS], "m", _AXES),
    )
    return Table("trust-map", "Accuracy and reliability of new points over the ground", columns, tuple(rows))


def limits_table(material: Material) -> Table:
    """The limits of the project for its trust map, and whether they are met."""
    own = [gate for gate in material.summary.gates if gate.name.startswith("trust_map")]
    return replace(gate_table(own), name="trust-limits", caption="Limits of the trust map")


def _row(pattern: str, words: str, values: Floats, share: float, unmapped: int) -> Row:
    place = max(int(np.ceil(share * (len(values) + unmapped))) - 1, 0)
    # Of cells that are not mapped nothing is known.
    at_share = np.sort(values, axis=0)[place] if place < len(values) else np.full(3, np.nan)
    cells_of = (np.median(values, axis=0), at_share, values.max(axis=0))
    shown = [number for row in cells_of for number in numbers(row, 3)]
    return Row(pattern.removesuffix("_{}_m"), (words, *numbers((float(len(values)),), 0), *shown))


def trust_map_plot(material: Material) -> Markup | None:
    """Cells coloured by the σ of the height of a new point; None without a map."""
    table, grid = material.trust_map, material.figures.trust_map_grid
    if table.empty or grid is None:
        return None
    words = "Map of the standard deviation of new heights"
    return sigma_map(table, _raster(grid), "σ height of a new point [m]", words)


def _raster(grid: TrustMapGrid) -> Raster:
    """Whole cells of the map combined, so that none is omitted."""
    together = -(-max(grid.rows, grid.columns) // _CELLS)
    size, rows, columns = together * grid.cell_m, -(-grid.rows // together), -(-grid.columns // together)
    return Raster(grid.west_m, grid.north_m - rows * size, size, rows, columns)


def trust_map_histogram(material: Material) -> Markup | None:
    """Part of the area by the σ of the height, with the limit of its gate; None without a map."""
    table, figure = material.trust_map, material.figures.trust_map
    if table.empty or figure is None:
        return None
    sigma = table["sigma_z_m"].to_numpy(np.float64)
    sigma = sigma[np.isfinite(sigma)]
    upper = 1.05 * float(np.quantile(sigma, 0.995))
    counts, edges = np.histogram(np.minimum(sigma, upper), bins=_BINS, range=(0.0, upper))
    parts = 100.0 * counts / len(sigma)
    x, y = Scale(0.0, upper, LEFT, RIGHT), Scale(0.0, 1.06 * float(parts.max()), 250.0, TOP)
    drawn, entries = [bars(x, y, edges, parts)], [Swatch(BAR, f"{len(sigma):,} cells")]
    gate = material.project.gates.trust_map_height_m
    limits = {f"{figure.share:.0%} of the area": (figure.sigma_m[2], palette.INK)}
    limits["limit of the gate"] = (None if gate is None else gate.max, palette.ACCENT)
    for words, (value, colour) in limits.items():
        if value is not None and value <= upper:
            entries.append(Swatch(colour, f"{words}: {value:.3f} m"))
            drawn.append(markup.curve(np.full(2, x.at(value)), np.array([y.start, y.end]), colour))
    return chart(
        "Histogram of the standard deviation of new heights",
        x,
        y,
        ("σ height [m] (last bar: all larger values)", "part of the area [%]"),
        drawn,
        entries,
        "new points",
    )
