"""Correlations of the system parameters as a heat map that stays readable with a hundred of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.documents.report.material import Material
from tasks.quantities import additional_set, named, quantity_words

#: A parameter in words, and its entity.
Label: TypeAlias = tuple[str, str]
_MOST_IN_MATRIX = 120
# Cells this large carry their coefficient, labels of rows this high are written in the usual size.
_LEAST_WITH_NUMBER = 30.0
_LEAST_FOR_TEXT = 14.0
_LEAST_FOR_TINY_TEXT = 9.0
# Below the first a cell stays white; from the second on it tells its coefficient to the pointer.
_LEAST_DRAWN = 0.025
_LEAST_TOLD = 0.3
_MOST_WITH_ALL_TOLD = 36


def correlation_matrix(table: pd.DataFrame) -> pd.DataFrame:
    """The symmetric matrix of all pairs by (parameter, entity), numbers in names by size."""
    of_a, of_b = (
        list(zip(table[name].map(quantity_words), table[of].astype(str), strict=True))
        for name, of in (("parameter_a", "entity_a"), ("parameter_b", "entity_b"))
    )
    names = sorted({*of_a, *of_b}, key=lambda name: natural_key(named(*name)))
    index = pd.Index(names)
    matrix = np.eye(len(names))
    first, second = index.get_indexer(pd.Index(of_a)), index.get_indexer(pd.Index(of_b))
    matrix[first, second] = matrix[second, first] = table["correlation"].to_numpy(np.float64)
    return pd.DataFrame(matrix, index=names, columns=names)


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """A key that sorts the numbers in names by size: bluh:2 before bluh:10."""
    pieces = re.findall(r"\d+|\D+", name)
    return tuple((0, int(piece), "") if piece.isdecimal() else (1, 0, piece) for piece in pieces)


def correlation_plot(material: Material) -> Markup | None:
    """Matrix of correlations as colours, coefficients on hover; None with fewer than two parameters."""
    matrix = correlation_matrix(material.correlations)
    return matrix_plot(matrix, "Correlations of the system parameters") if len(matrix) > 1 else None


def matrix_plot(matrix: pd.DataFrame, words: str) -> Markup:
    """The triangle under the diagonal of a matrix of correlations, two or more by (parameter, entity).

    Parameters
    ----------
    words : what is drawn, for who cannot see it.
    """
    strongest = matrix.abs().where(~np.eye(len(matrix), dtype=bool)).max(axis=1)
    chosen = set(strongest.sort_values(ascending=False, kind="stable").head(_MOST_IN_MATRIX).index)
    own = np.array([name in chosen for name in matrix.index])
    names: list[Label] = [name for name in matrix.index if name in chosen]
    values = matrix.to_numpy(np.float64)[np.ix_(own, own)]
    shown = _without_common_entity(names)
    left = min(40.0 + 6.6 * max(len(name) for name in shown), 320.0)
    side = _side(left, 40.0, len(names))
    if side < _LEAST_FOR_TEXT:
        # The names stand beside the diagonal, too.
        side = _side(left, 10.0 + 5.2 * max(len(parameter) for parameter, _ in names), len(names))
    top = 10.0
    parts = [
        *_cells(left, top, side, values, [named(*name) for name in names]),
        markup.group("axis", _separators(left, top, side, names)),
        *_labels(left, top, side, shown, [words for words, _ in names]),
    ]
    height = top + len(names) * side + 10
    parts.append(_key(left, height))
    return markup.svg(axes.WIDTH, height + 44, words, *parts)


def _side(left: float, right: float, count: int) -> float:
    """Of a cell, with room to the left and to the right of the matrix."""
    return float(np.clip((axes.WIDTH - left - right) / count, 5.0, 44.0))


def _without_common_entity(names: Sequence[Label]) -> list[str]:
    """Parameters with their entities, or without where all belong to the same."""
    several = len({entity for _, entity in names}) > 1
    return [named(*name) if several else name[0] for name in names]


def _cells(left: float, top: float, side: float, values: Floats, names: Sequence[str]) -> list[Markup]:
    """The triangle under the diagonal: cells that tell their coefficient, the others as one path a colour."""
    all_told = len(names) <= _MOST_WITH_ALL_TOLD
    silent: dict[str, list[str]] = {}
    told = []
    for row, column in np.argwhere(np.tri(len(names), k=-1, dtype=bool)).tolist():
        value = float(values[row, column])
        x, y, size = left + column * side, top + row * side, side - min(1.0, 0.08 * side)
        if all_told or abs(value) >= _LEAST_TOLD:
            words = f"{names[row]} and {names[column]}: {value:+z.3f}"
            told.append(_told_cell(x, y, size, value, words))
        elif abs(value) >= _LEAST_DRAWN:
            length = markup.number(size)
            square = f"M{markup.number(x)},{markup.number(y)}h{length}v{length}h-{length}z"
            silent.setdefault(palette.signed(round(value / 0.05) * 0.05), []).append(square)
    paths = [markup.element("path", fill=colour, d="".join(squares)) for colour, squares in silent.items()]
    return [*paths, *told]


def _told_cell(x: float, y: float, size: float, value: float, words: str) -> Markup:
    parts = [markup.rectangle(x, y, size, size, markup.title(words), fill=palette.signed(value))]
    if size >= _LEAST_WITH_NUMBER - 1.0:
        css = "inverse" if abs(value) > 0.6 else ""
        shown = f"{value:.2f}".replace("-0.00", "0.00").replace("-", "−")
        parts.append(markup.text(x + 0.5 * size, y + 0.5 * size + 4, shown, css_class=css))
    return Markup("").join(parts)


def _labels(
    left: float, top: float, side: float, names: Sequence[str], parameters: Sequence[str]
) -> list[Markup]:
    """Names next to the rows, numbers on the diagonal; of rows too low for text every second or third."""
    every = int(np.ceil(_LEAST_FOR_TINY_TEXT / side))
    css = "" if side >= _LEAST_FOR_TEXT else "tiny"
    parts = []
    for row in range(0, len(names), every):
        middle = top + (row + 0.5) * side + (4.0 if side >= _LEAST_FOR_TEXT else 3.0)
        numbered = f"{row + 1}: {names[row]}" if side >= _LEAST_FOR_TEXT else names[row]
        parts.append(markup.text(left - 8, middle, numbered, "end", css))
        beside = str(row + 1) if side >= _LEAST_FOR_TEXT else parameters[row]
        if side >= _LEAST_FOR_TEXT:
            parts.append(markup.text(left + (row + 0.5) * side, middle, beside))
        else:
            parts.append(markup.text(left + row * side + 2.0, middle, beside, "start", css))
    return parts


def _separators(left: float, top: float, side: float, names: Sequence[Label]) -> list[Markup]:
    """Lines between the sets of additional parameters, and between them and other parameters."""
    lines = []
    for place, (one, other) in enumerate(pairwise(names), start=1):
        if additional_set(one[0]) != additional_set(other[0]):
            at = place * side
            lines.append(markup.line(left, top + at, left + at, top + at))
            lines.append(markup.line(left + at, top + at, left + at, top + len(names) * side))
    return lines


def _key(left: float, top: float) -> Markup:
    """Colours from −1 to 1."""
    parts = []
    for step, value in enumerate(np.linspace(-1.0, 1.0, 9)):
        colour = palette.signed(float(value))
        parts.append(markup.rectangle(left + step * 30, top, 30, 12, fill=colour, css="swatch"))
    parts += [
        markup.text(left + 30 * (4 + 4 * v) + 15, top + 26, f"{v:g}".replace("-", "−")) for v in (-1, 0, 1)
    ]
    return markup.group("legend", parts)
