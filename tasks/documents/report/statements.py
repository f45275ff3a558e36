"""Statements about accuracy: in the report, and as a page of their own to be signed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from tasks.accuracy.statement import decimals_beyond
from tasks.document_kit.row_table import number_of, numbers_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Number, Row, Table, numbers, text_column
from tasks.document_kit.templates import rendered
from tasks.results.figures import StatementFigure

_POINTS = {
    "plan": "with a position",
    "height": "with a height",
    "both": "with both",
    "vegetated": "under vegetation",
}
_CASES = {
    "none": "no points",
    "too_few": "too few points",
    "undefined": "not defined",
    "found": "stated",
    "met": "met",
    "missed": "NOT met",
}


def figures_table(statements: Sequence[StatementFigure]) -> Table:
    """Every quantity of every statement next to its limit."""
    columns = (
        text_column("standard", "statement"),
        text_column("points", "check points"),
        Column("number", "number"),
        Column("least", "needed"),
        text_column("quantity", "quantity"),
        Column("value", "value", "m"),
        Column("limit", "limit", "m"),
        text_column("verdict", "verdict"),
    )
    rows = []
    for place, one in enumerate(statements):
        for part in one.parts:
            for name in dict.fromkeys((*part.figures_m, *part.limits_m)) or ("–",):
                beyond = name in part.exceeded
                value, limit = part.figures_m.get(name), part.limits_m.get(name)
                decimals = decimals_beyond(value or 0.0, math.nan if limit is None else limit, 4)
                cells: tuple[Cell, ...] = (
                    f"{one.standard}, {one.edition}",
                    _POINTS[part.points],
                    Number(part.number),
                    Number(one.check_points_needed),
                    name,
                    *numbers((value, limit), decimals),
                    _CASES["missed"] if beyond and part.number else _CASES[part.case],
                )
                rows.append(Row(f"{place}:{part.points}:{name}", cells))
    return Table("statement-figures", "Figures of the statements", columns, tuple(rows))


def render(statements: Sequence[StatementFigure], check_points: pd.DataFrame, name: str) -> str:
    """The page of its own, with every check point."""
    tables = {table.name: table for table in (figures_table(statements), _points(check_points))}
    folder = Path(__file__).parent / "templates"
    return rendered("statements_page.html.j2", folder, name=name, statements=statements, tables=tables)


def _points(check_points: pd.DataFrame) -> Table:
    shown = (
        text_of("point", "point"),
        *numbers_of("d{}_m", ("d east", "d north", "d up"), "m", "xyz", 3, plus=True),
        number_of("rays", "rays"),
    )
    return table_of("statement-points", "Check points, computed − given", shown, check_points, "{point}")
