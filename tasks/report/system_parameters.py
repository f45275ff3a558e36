"""System parameters with their σ and status, and how they are correlated."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from tasks.report import axes, markup, palette
from tasks.report.material import Material
from tasks.report.table import Cell, Column, Row, Table, decimals_for, numbers, text_column

MOST_ROWS = 80
_MOST_IN_MATRIX = 36
_WORDS = {
    "significant": "significant",
    "not_significant": "not significant",
    "eliminated": "eliminated",
    "fixed": "held at its given value",
    "prior_only": "known from its prior only: this block adds nothing",
    "not_determinable": "not determinable: inseparable from others in this block",
}


def parameter_table(material: Material) -> Table:
    """The estimated parameters."""
    table = material.parameters
    estimated = table[table["sigma"].notna()]
    shown = estimated.head(MOST_ROWS)
    held = len(table) - len(estimated)
    notes = []
    if len(shown) < len(estimated):
        notes.append(f"The first {len(shown)} of {len(estimated):,}; all in parameters.parquet.")
    if held:
        more = " more" if len(estimated) else ""
        notes.append(f"{held}{more} are held at their given values (parameters.parquet).")
    columns = (
        text_column("parameter", "parameter"),
        text_column("entity", "of"),
        Column("value", "value"),
        Column("sigma", "σ"),
        Column("change", "change"),
        Column("t", "t"),
        Column("sigma_prior", "σ prior"),
        text_column("unit", "unit"),
        text_column("status", "status"),
    )
    rows = tuple(_row(row) for row in shown.to_dict("records"))
    return Table("parameters", "Estimated system parameters", columns, rows, " ".join(notes))


def _row(row: Mapping[Hashable, Any]) -> Row:
    """A parameter with as many decimals as give its σ two digits."""
    value, sigma, change, t, prior = (
        float(str(row[n])) for n in ("value", "sigma", "change", "t", "sigma_prior")
    )
    decimals = decimals_for(sigma)
    cells: tuple[Cell, ...] = (
        parameter_words(str(row["parameter"])),
        str(row["entity"]),
        *numbers((value,), decimals),
        *numbers((sigma,), decimals),
        *numbers((change,), decimals, plus=True),
        *numbers((t,), 1, plus=True),
        *numbers((prior,), decimals_for(prior)),
        str(row["unit"]),
        _WORDS.get(str(row["status"]), str(row["status"])),
    )
    return Row(f"{row['parameter']}@{row['entity']}", cells)


def parameter_words(name: object) -> str:
    """The name of a parameter for people."""
    return str(name).replace("_", " ").replace("gnss", "GNSS")


def correlation_plot(material: Material) -> Markup | None:
    """Matrix of correlations as colours, coefficients on hover; None with fewer than two parameters."""
    table = material.correlations
    matrix = correlation_matrix(table)
    if len(matrix) < 2:
        return None
    strongest = matrix.abs().where(~np.eye(len(matrix), dtype=bool)).max(axis=1)
    chosen = strongest.sort_values(ascending=False, kind="stable").head(_MOST_IN_MATRIX).index
    names = [name for name in matrix.index if name in set(chosen)]
    side = float(np.clip(560.0 / len(names), 15.0, 44.0))
    left, top = 300.0, 10.0
    parts = []
    for row, first in enumerate(names):
        parts.append(markup.text(left - 8, top + (row + 0.5) * side + 4, f"{row + 1}: {first}", "end"))
        parts.append(markup.text(left + (row + 0.5) * side, top + (row + 0.5) * side + 4, str(row + 1)))
        for column, second in enumerate(names[:row]):
            value = float(str(matrix.loc[first, second]))
            x, y = left + column * side, top + row * side
            parts.append(_cell(x, y, side, value, f"{first} and {second}: {value:+.3f}"))
    height = top + len(names) * side + 10
    parts.append(_key(left, height))
    return markup.svg(axes.WIDTH, height + 44, "Correlations of the system parameters", *parts)


def correlation_matrix(table: pd.DataFrame) -> pd.DataFrame:
    """The symmetric matrix of all pairs, named "parameter of entity", in the order of the table."""
    of_a = table["parameter_a"].map(parameter_words) + " of " + table["entity_a"].astype(str)
    of_b = table["parameter_b"].map(parameter_words) + " of " + table["entity_b"].astype(str)
    names = sorted({*of_a, *of_b})
    index = pd.Index(names)
    matrix = np.eye(len(names))
    first, second = index.get_indexer(pd.Index(of_a)), index.get_indexer(pd.Index(of_b))
    matrix[first, second] = matrix[second, first] = table["correlation"].to_numpy(np.float64)
    return pd.DataFrame(matrix, index=names, columns=names)


def _cell(x: float, y: float, side: float, value: float, words: str) -> Markup:
    square: dict[str, markup.Attribute] = {"x": x, "y": y, "width": side - 1, "height": side - 1}
    parts = [markup.element("rect", square | {"fill": palette.signed(value)}, markup.title(words))]
    if side >= 30.0:
        css = "inverse" if abs(value) > 0.6 else ""
        shown = f"{value:.2f}".replace("-0.00", "0.00").replace("-", "−")
        parts.append(markup.text(x + 0.5 * side, y + 0.5 * side + 4, shown, css_class=css))
    return Markup("").join(parts)


def _key(left: float, top: float) -> Markup:
    """Colours from −1 to 1."""
    parts = []
    for step, value in enumerate(np.linspace(-1.0, 1.0, 9)):
        box: dict[str, markup.Attribute] = {"x": left + step * 30, "y": top, "width": 30, "height": 12}
        parts.append(markup.element("rect", box | {"fill": palette.signed(float(value)), "class": "swatch"}))
    parts += [
        markup.text(left + 30 * (4 + 4 * v) + 15, top + 26, f"{v:g}".replace("-", "−")) for v in (-1, 0, 1)
    ]
    return markup.group("legend", parts)
