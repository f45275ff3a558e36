"""Standard deviations of the object points by number of rays and over the block."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import tick_step
from tasks.document_kit.legend import Swatch
from tasks.document_kit.map_plot import MapPlot
from tasks.document_kit.raster import Classes, Raster, cells
from tasks.document_kit.table import Column, Row, Table, components, numbers, text_column
from tasks.documents.report.material import Material

_CELLS = 60
_ABOUT_CLASSES = 6
_AXES = ("x", "y", "z")
_HEADINGS = ("east", "north", "height")
# Points with this many rays and more are in one row.
MANY_RAYS = 10


def point_table(material: Material) -> Table:
    """Median and largest σ of the points with 1, 2, … rays and of all points."""
    points = material.object_points
    rays = points["rays"].to_numpy(np.int64)
    sigma = points[[f"sigma_{axis}_m" for axis in _AXES]].to_numpy(np.float64)
    rows = []
    for count in np.unique(np.minimum(rays, MANY_RAYS)):
        chosen = np.minimum(rays, MANY_RAYS) == count
        words = f"{count} and more" if count == MANY_RAYS and rays.max() > MANY_RAYS else str(count)
        rows.append(_row(str(count), words, sigma[chosen]))
    if len(sigma):
        rows.append(_row("all", "all", sigma))
    columns = (
        text_column("rays", "rays"),
        Column("points", "points"),
        *components("median_{}_m", [f"median σ {h}" for h in _HEADINGS], "m", _AXES),
        *components("max_{}_m", [f"largest σ {h}" for h in _HEADINGS], "m", _AXES),
    )
    return Table("point-sigmas", "Standard deviations of the object points", columns, tuple(rows))


def _row(key: str, words: str, sigma: Floats) -> Row:
    median, largest = np.median(sigma, axis=0), np.max(sigma, axis=0)
    return Row(key, (words, *numbers((float(len(sigma)),), 0), *numbers(median, 3), *numbers(largest, 3)))


def height_precision_map(material: Material) -> Markup:
    """Cells coloured by the median σ of the heights of their points; needs at least one point."""
    points = material.object_points
    x, y = (points[name].to_numpy(np.float64) for name in ("x_m", "y_m"))
    raster = Raster.over(x, y, min(_CELLS, max(4, int(np.sqrt(len(points))))))
    return sigma_map(points, raster, "median σ height [m]", "Map of the standard deviation of heights")


def sigma_map(points: pd.DataFrame, raster: Raster, heading: str, description: str) -> Markup:
    """A map of the median `sigma_z_m` of points in each cell of a raster."""
    x, y, sigma = (points[name].to_numpy(np.float64) for name in ("x_m", "y_m", "sigma_z_m"))
    median = raster.median(x, y, sigma)
    classes = height_classes(median[np.isfinite(median)])
    colours = palette.sequence(len(classes.words))
    plot = MapPlot.over(x, y)
    entries = [Swatch(colour, words) for colour, words in zip(colours, classes.words, strict=True)]
    legend, bottom = plot.legend(heading, entries)
    titles = [f"{words} m" for words in classes.words]
    drawn = cells(raster, plot, classes.of(median), colours, titles)
    return markup.svg(axes.WIDTH, bottom + 6, description, plot.axes(), drawn, legend)


def height_classes(values: Floats) -> Classes:
    """Classes of round width over the middle 96 % of the values; the outermost ones are open."""
    low, high = (float(v) for v in np.percentile(values, [2.0, 98.0]))
    step = tick_step(max(high - low, 0.02 * high, 1e-6), _ABOUT_CLASSES)
    bounds = np.arange(np.floor(low / step) + 1, np.ceil(high / step)) * step
    bounds = bounds if len(bounds) else np.array([np.ceil(high / step) * step])
    return Classes.between(bounds, step)
