"""Standard deviations of the exterior orientations: as a table, and along the strips."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats, Ints
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches
from tasks.document_kit.row_table import number_of, numbers_of, omitted, table_of, text_of
from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.material import Material
from tasks.documents.report.residual_tables import MOST_LISTED

_MDEG = 1e3
# More places along the plot than this cannot be separated on a screen.
_MOST_PLACES = 900
_MOST_STRIP_NAMES = 30

#: Column of the table, symbol, unit shown, factor.
COMPONENTS = (
    ("sigma_x_m", "σ east", "m", 1.0),
    ("sigma_y_m", "σ north", "m", 1.0),
    ("sigma_z_m", "σ height", "m", 1.0),
    ("sigma_omega_deg", "σ ω", "mdeg", _MDEG),
    ("sigma_phi_deg", "σ φ", "mdeg", _MDEG),
    ("sigma_kappa_deg", "σ κ", "mdeg", _MDEG),
)


def orientation_table(material: Material) -> Table:
    """Least, median and largest standard deviation of each component, and where it is largest."""
    images = material.oriented
    columns = (
        text_column("component", "component"),
        text_column("unit", "unit"),
        Column("min", "least"),
        Column("median", "median"),
        Column("max", "largest"),
        text_column("image", "largest in image"),
    )
    rows = []
    for name, symbol, unit, factor in COMPONENTS:
        values = images[name].to_numpy(np.float64) * factor
        figures = [float(values.min()), float(np.median(values)), float(values.max())]
        where = str(images["image"].iloc[int(np.argmax(values))])
        rows.append(Row(name, (symbol, unit, *numbers(figures, decimals_for(figures[0])), where)))
    return Table("orientation-sigmas", "Standard deviations of the orientations", columns, tuple(rows))


_LISTED = (
    text_of("image", "image"),
    text_of("strip", "strip"),
    *numbers_of("{}_m", ("east", "north", "height"), "m", "xyz", 3),
    *numbers_of("{}_deg", "ωφκ", "°", ("omega", "phi", "kappa"), 5),
    *(
        number_of(name, symbol, unit, 3 if unit == "m" else 2, factor=factor)
        for name, symbol, unit, factor in COMPONENTS
    ),
)


def orientation_list(material: Material) -> Table:
    """The orientation of every image with its standard deviations, by strip and name."""
    images = material.oriented
    listed = images.head(MOST_LISTED)
    note = omitted(listed, images, "exterior_orientations.parquet")
    caption = "Exterior orientations of the images"
    return table_of("orientation-list", caption, _LISTED, listed, "{image}", note)


def neighbour_table(material: Material) -> Table:
    """Correlation of neighbouring images of strips, and σ of their differences."""
    columns = (
        text_column("component", "component"),
        Column("min", "ρ least"),
        Column("median", "ρ median"),
        Column("max", "ρ largest"),
        text_column("unit", "unit"),
        Column("sigma", "median σ of the difference"),
        Column("largest", "largest"),
        text_column("image", "between"),
    )
    pairs, rows = material.neighbours, []
    for name, symbol, unit, factor in COMPONENTS if len(material.neighbours) else ():
        axis = name.split("_")[1]
        rho = pairs[f"rho_{axis}"].to_numpy(np.float64)
        sigma = pairs[name.replace("sigma_", "sigma_d")].to_numpy(np.float64) * factor
        worst = pairs.iloc[int(np.argmax(sigma))]
        cells: tuple[Cell, ...] = (
            symbol.removeprefix("σ "),
            *numbers((float(rho.min()), float(np.median(rho)), float(rho.max())), 2),
            unit,
            *numbers((float(np.median(sigma)), float(sigma.max())), decimals_for(float(np.median(sigma)))),
            f"{worst['image']}, {worst['next_image']}",
        )
        rows.append(Row(axis, cells))
    note = f"{len(pairs):,} successive pairs of a strip; all in neighbouring_images.parquet."
    return Table("neighbours", "Correlation of neighbouring images", columns, tuple(rows), note)


def orientation_plot(material: Material) -> Markup:
    """Two panels over the images in the order of flight: positions above, attitudes below."""
    images = material.oriented
    place = _places(len(images))
    left, right = 78.0, axes.WIDTH - 12.0
    x = Scale(-0.5, max(len(images) - 0.5, 0.5), left, right)
    parts: list[Markup] = []
    top = 20.0
    for panel, label in (
        (COMPONENTS[:3], "σ of the position [m]"),
        (COMPONENTS[3:], "σ of the attitude [mdeg]"),
    ):
        bottom = top + 200.0
        parts.append(_strip_borders(images, x, top, bottom, named=top < 100.0))
        largest = max(float((images[name] * factor).max()) for name, _, _, factor in panel)
        y = Scale(0.0, 1.08 * largest if largest > 0 else 1.0, bottom, top)
        parts.append(axes.vertical_axis(y, left, right, label))
        for index, (name, _, _, factor) in enumerate(panel):
            middle, values = _binned(images[name].to_numpy(np.float64) * factor, place)
            parts.append(_curves(images, middle, x.of(middle), y.of(values), palette.category(index)))
        parts.append(axes.frame(left, top, right, bottom))
        names = [Swatch(palette.category(i), item[1]) for i, item in enumerate(panel)]
        legend, top = swatches(left, bottom + 8, "", names, right - left)
        parts.append(legend)
        top += 14
    caption = "images in the order strip, name"
    parts.append(markup.text(0.5 * (left + right), top, caption, css_class="label"))
    return markup.svg(axes.WIDTH, top + 10, "Standard deviations along the strips", *parts)


def _places(count: int) -> Ints:
    """Place (n,) of each image along the plot; neighbours share one when there are very many."""
    together = max(1, int(np.ceil(count / _MOST_PLACES)))
    return np.arange(count, dtype=np.int64) // together


def _binned(values: Floats, place: Ints) -> tuple[Floats, Floats]:
    """Middle number and largest value of the images at each place."""
    _, first, count = np.unique(place, return_index=True, return_counts=True)
    return first + 0.5 * (count - 1), np.fmax.reduceat(values, first) if len(first) else values


def _starts(images: pd.DataFrame) -> Ints:
    """Numbers of the images at which a strip begins, the first one left out."""
    strip = images["strip"].to_numpy(dtype=object)
    return np.flatnonzero(strip[1:] != strip[:-1]) + 1


def _curves(images: pd.DataFrame, middle: Floats, x: Floats, y: Floats, colour: str) -> Markup:
    """A line for each strip: values of different strips are not joined."""
    cuts = np.searchsorted(middle, _starts(images))
    pieces = zip(np.split(x, cuts), np.split(y, cuts), strict=True)
    data = "".join(
        markup.path_of(px, py) if len(px) > 1 else f"M{markup.number(px[0] - 1)},{markup.number(py[0])}h2"
        for px, py in pieces
        if len(px)
    )
    return markup.element("path", css="curve", stroke=colour, d=data)


def _strip_borders(images: pd.DataFrame, x: Scale, top: float, bottom: float, *, named: bool) -> Markup:
    """Lines between strips, and their names above."""
    starts = _starts(images)
    parts = [markup.line(x.at(start - 0.5), top, x.at(start - 0.5), bottom) for start in starts]
    first = [0, *starts.tolist()]
    names = images["strip"].iloc[first].tolist()
    if named and len(first) <= _MOST_STRIP_NAMES and any(names):
        behind = [*first[1:], len(images)]
        parts += [
            markup.text(x.at(0.5 * (a + b - 1)), top - 6, name)
            for a, b, name in zip(first, behind, names, strict=True)
        ]
    return markup.group("axis", parts)
