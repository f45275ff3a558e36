"""Tests of the model: the strongest alternatives, and the errors that this block would not find."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
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
    listed = ordered.head(MOST)
    note = (
        f"The {len(listed)} strongest of {len(known):,} that were tested; all in model_alternatives.parquet."
    )
    caption = "Tested deficiencies of the model, most significant first"
    return table_of("model-alternatives", caption, _STRONGEST, listed, _key, note)


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
    note = (
        "Size detected with a probability of 80 % among all other tests. Without a number: this block "
        "cannot separate it from the parameter it affects, regardless of its size; that it is zero is an "
        "assumption. All in model_alternatives.parquet and model_alternative_effects.parquet."
    )
    caption = "Errors that may remain undetected"
    return table_of("unnoticed-errors", caption, _UNNOTICED, chosen.head(MOST), _key, note)


def _size(row: Mapping[Hashable, Any]) -> float:
    return float(row["explained" if row["rank"] > 0 else "estimate"]) * _factor(row)


def _sigma(row: Mapping[Hashable, Any]) -> float:
    return float(row["explained_sigma" if row["rank"] > 0 else "sigma"]) * _factor(row)


def _detectable(row: Mapping[Hashable, Any]) -> float:
    return float(row["detectable"]) * _factor(row)


def _factor(row: Mapping[Hashable, Any]) -> float:
    return shown(str(row["unit"])).factor


def _unit(row: Mapping[Hashable, Any]) -> str:
    return shown(str(row["unit"])).unit


def _of_known_size(read: Callable[[Mapping[Hashable, Any]], Any]) -> Callable[[Mapping[Hashable, Any]], Any]:
    """What is read where the detectable size is finite; otherwise nothing."""
    return lambda row: read(row) if np.isfinite(row["detectable"]) else None


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


_STRONGEST = (
    text_of("alternative", "possible difference", _what),
    number_of("estimate", "size", decimals=lambda row: decimals_for(_sigma(row)), plus=True, of=_size),
    number_of("sigma", "σ", decimals=lambda row: decimals_for(_sigma(row)), of=_sigma),
    text_of("unit", "unit", _unit),
    number_of("t", "t", decimals=1, plus=True, of=lambda row: _size(row) / _sigma(row)),
    text_of("finding", "significant", _significance),
    text_of("moves", "moves most", _moved),
    number_of("moved_by", "by", "σ", 1, of="moved_by_estimate"),
)
_UNNOTICED = (
    text_of("alternative", "an error of", _what),
    number_of(
        "detectable", "detected from", decimals=lambda row: decimals_for(_detectable(row)), of=_detectable
    ),
    text_of("unit", "unit", _of_known_size(_unit)),
    text_of("moves", "below this it may change", _moved),
    number_of("moved_by", "by up to", "σ", 1, of=_of_known_size(lambda row: row["moved"])),
)
