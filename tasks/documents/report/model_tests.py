"""Tests of the model: the strongest alternatives, and the errors that this block would not find."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, text_column
from tasks.documents.report.material import Material
from tasks.evaluation.alternative_words import alternative_words
from tasks.quantities import entity_words, shown

#: Rows of each table.
MOST = 15
# An error that stays unnoticed and moves nothing by more than this, in σ, is not worth a row.
_WORTH_SAYING = 1.0


def strongest_table(material: Material) -> Table:
    """The alternatives with the largest |t|; those that explain the misclosures together come first."""
    table = material.model_alternatives
    known = table[table["t"].notna()]
    place = known["rank"].where(known["rank"] > 0, len(table) + 1)
    size = known["t"].abs()
    ordered = known.assign(place=place, size=size).sort_values(
        ["place", "size"], ascending=[True, False], kind="stable"
    )
    columns = (
        text_column("alternative", "possible difference"),
        Column("estimate", "size"),
        Column("sigma", "σ"),
        text_column("unit", "unit"),
        Column("t", "t"),
        text_column("finding", "significant"),
        text_column("moves", "moves most"),
        Column("moved_by", "by", "σ"),
    )
    rows = tuple(_strongest_row(row) for row in ordered.head(MOST).to_dict("records"))
    note = f"The {len(rows)} strongest of {len(known):,} that were tested; all in model_alternatives.parquet."
    return Table(
        "model-alternatives", "Tested deficiencies of the model, most significant first", columns, rows, note
    )


def _strongest_row(row: Mapping[Hashable, Any]) -> Row:
    unit, factor, _ = shown(str(row["unit"]))
    sizes = ("explained", "explained_sigma") if row["rank"] > 0 else ("estimate", "sigma")
    value, sigma = (float(row[name]) * factor for name in sizes)
    decimals = decimals_for(sigma)
    return Row(
        _key(row),
        (
            _what(row),
            Number(value, decimals, plus=True),
            Number(sigma, decimals),
            unit,
            Number(value / sigma, 1, plus=True),
            _significance(row),
            _moved(row),
            Number(float(row["moved_by_estimate"]), 1),
        ),
    )


def unnoticed_table(material: Material) -> Table:
    """Alternatives whose smallest detectable error moves a parameter notably, and undetectable ones."""
    table = material.model_alternatives
    moved = table["moved_by_detectable"].where(table["t"].notna(), np.inf)
    table = table.assign(moved=moved)
    table = table[(table["moved"] > _WORTH_SAYING) & table["moves"].notna()]
    # Of the strips, and of the axes of one thing, the worst one stands for all.
    table = table.sort_values("moved", ascending=False, kind="stable")
    strips = table["scope"] == "strip"
    chosen = pd.concat([table[~strips], table[strips].drop_duplicates("quantity")])
    chosen = chosen.sort_values("moved", ascending=False, kind="stable")
    columns = (
        text_column("alternative", "an error of"),
        Column("detectable", "detected from"),
        text_column("unit", "unit"),
        text_column("moves", "below this it may change"),
        Column("moved_by", "by up to", "σ"),
    )
    rows = tuple(_unnoticed_row(row) for row in chosen.head(MOST).to_dict("records"))
    note = (
        "Size detected with a probability of 80 % among all other tests. Without a number: this block "
        "cannot separate it from the parameter it affects, regardless of its size; that it is zero is an "
        "assumption. All in model_alternatives.parquet and model_alternative_effects.parquet."
    )
    return Table("unnoticed-errors", "Errors that may remain undetected", columns, rows, note)


def _unnoticed_row(row: Mapping[Hashable, Any]) -> Row:
    unit, factor, _ = shown(str(row["unit"]))
    detectable = float(row["detectable"]) * factor
    known = np.isfinite(detectable)
    return Row(
        _key(row),
        (
            _what(row),
            Number(detectable, decimals_for(detectable)),
            unit if known else "",
            _moved(row),
            Number(float(row["moved"]) if known else None, 1),
        ),
    )


def _what(row: Mapping[Hashable, Any]) -> str:
    return " of ".join(filter(None, (alternative_words(row), str(row["entity"]))))


def _significance(row: Mapping[Hashable, Any]) -> str:
    if row["rank"] > 0:
        return f"yes, number {row['rank']}"
    return "explained by the others" if abs(row["estimate"]) > row["detectable"] else "no"


def _moved(row: Mapping[Hashable, Any]) -> str:
    return entity_words(str(row["moves"]), str(row["moves_entity"])) if row["moves"] else ""


def _key(row: Mapping[Hashable, Any]) -> str:
    return "|".join(str(row[name]) for name in ("quantity", "entity", "scope", "part"))
