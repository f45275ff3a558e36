"""What fixes the block in space: the part each group of observations has in each direction."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from tasks.document_kit import axes, markup, palette
from tasks.document_kit.legend import Swatch, swatches
from tasks.document_kit.table import Cell, Column, Row, Table, numbers, text_column
from tasks.documents.report.material import Material
from tasks.quantities import group_words
from tasks.results.figures import DatumFigure


def _shown(figure: DatumFigure) -> tuple[float | None, int, str]:
    """σ of a direction in its customary unit: value, decimals, unit."""
    factor, decimals, unit = 1.0, 3, "m"
    if figure.direction.startswith("rotation"):
        factor, decimals, unit = 1e3 * float(np.rad2deg(1.0)), 2, "mdeg"
    elif figure.direction == "scale":
        factor, decimals, unit = 1e6, 1, "ppm"
    return (None if figure.sigma is None else figure.sigma * factor), decimals, unit


def _groups(material: Material) -> list[str]:
    """Groups that hold anything, in the order of the adjustment."""
    held = {name for figure in material.figures.datum for name in figure.held_by}
    ordered = [group.group for group in material.figures.groups if group.group in held]
    return [*dict.fromkeys(ordered), *sorted(held - set(ordered))]


def datum_table(material: Material) -> Table:
    """σ of each direction and the shares of the groups."""
    groups = _groups(material)
    columns = (
        text_column("direction", "direction"),
        Column("sigma", "σ if nothing else were unknown"),
        text_column("unit", "unit"),
        *(Column(name, group_words(name), "%") for name in groups),
    )
    rows = []
    for figure in material.figures.datum:
        sigma, decimals, unit = _shown(figure)
        shares = [None if name not in figure.held_by else 100.0 * figure.held_by[name] for name in groups]
        held: tuple[Cell, ...] = ("not determined", "")
        if sigma is not None:
            held = (*numbers((sigma,), decimals), unit)
        cells: tuple[Cell, ...] = (figure.direction, *held, *numbers(shares, 1))
        rows.append(Row(figure.direction, cells))
    return Table("datum", "Share of each group in the datum", columns, tuple(rows))


def datum_plot(material: Material) -> Markup | None:
    """The shares as bars; None if nothing holds the datum."""
    groups = _groups(material)
    if not groups:
        return None
    left, right, height = 150.0, axes.WIDTH - 12.0, 22.0
    parts = []
    for row, figure in enumerate(material.figures.datum):
        y = 8.0 + row * (height + 6.0)
        parts.append(markup.text(left - 10, y + 15, figure.direction, "end"))
        x = left
        for index, name in enumerate(groups):
            share = figure.held_by.get(name, 0.0)
            width = share * (right - left)
            if width <= 0.0:
                continue
            words = markup.title(f"{figure.direction}: {group_words(name)} {share:.1%}")
            parts.append(markup.rectangle(x, y, width, height, words, fill=palette.category(index)))
            if width > 40.0:
                parts.append(markup.text(x + 0.5 * width, y + 15, f"{share:.0%}", css_class="inverse"))
            x += width
    entries = [Swatch(palette.category(i), group_words(name)) for i, name in enumerate(groups)]
    y = 8.0 + len(material.figures.datum) * (height + 6.0) + 6.0
    legend, bottom = swatches(left, y, "", entries, right - left)
    return markup.svg(axes.WIDTH, bottom + 4, "Shares of the groups in the datum", *parts, legend)
