"""Rejected and uncontrolled observations."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.row_table import number_of, omitted, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.quantities import group_words, unit_words

MOST_REJECTED = 60
MOST_UNCONTROLLED = 40
MOST_IMAGES = 20


def rejected_table(material: Material) -> Table:
    """Rejected components, the largest |v|/σ first."""
    table = material.residuals
    rejected = table[table["status"] == "rejected"].copy()
    rejected["ratio"] = (rejected["residual"] / rejected["sigma"]).abs()
    rejected = rejected.sort_values("ratio", ascending=False, kind="stable")
    listed = rejected.head(MOST_REJECTED)
    note = omitted(listed, rejected, 'residuals.parquet (status "rejected")', largest=True)
    shown = (*OBSERVATION, *RESIDUAL, number_of("ratio", "|v|/σ", decimals=1))
    return table_of(
        "rejected", "Rejected components, the largest |v|/σ first", shown, listed, observation_key, note
    )


def uncontrolled_images(material: Material) -> Table:
    """Images with the most uncontrolled image coordinates."""
    table = material.residuals
    took_part = (table["group"] == IMAGE_POINTS) & table["status"].isin(["used", "uncontrolled"])
    own = table.loc[took_part, ["image", "status"]]
    counted = (
        pd.DataFrame({"image": own["image"], "few": own["status"] == "uncontrolled"})
        .groupby("image")["few"]
        .agg(uncontrolled="sum", coordinates="size")
        .reset_index()
    )
    counted = counted[counted["uncontrolled"] > 0].sort_values("uncontrolled", ascending=False, kind="stable")
    counted["share"] = 100.0 * counted["uncontrolled"] / counted["coordinates"]
    listed = counted.head(MOST_IMAGES)
    note = (
        "" if len(listed) == len(counted) else f"The {len(listed)} images with the most of {len(counted):,}."
    )
    shown = (
        text_of("image", "image"),
        number_of("uncontrolled", "uncontrolled coordinates"),
        number_of("coordinates", "of"),
        number_of("share", "share", "%", 1),
    )
    caption = "Uncontrolled image coordinates by image"
    return table_of("uncontrolled-images", caption, shown, listed, "{image}", note)


def uncontrolled_table(material: Material) -> Table:
    """Uncontrolled observations other than image points, the least redundancy first."""
    table = material.residuals
    others = table[(table["status"] == "uncontrolled") & (table["group"] != IMAGE_POINTS)]
    others = others.sort_values("redundancy", kind="stable")
    listed = others.head(MOST_UNCONTROLLED)
    note = omitted(listed, others, "residuals.parquet")
    shown = (*OBSERVATION, number_of("redundancy", "redundancy number", decimals=3))
    return table_of("uncontrolled", "Other uncontrolled observations", shown, listed, observation_key, note)


def observation_key(row: Mapping[Hashable, Any]) -> str:
    """The key of a row of residuals.parquet."""
    return "|".join([str(row["group"]), _name(row["image"]), _name(row["point"]), str(row["component"])])


def _name(value: object) -> str:
    """The name of an image or point; empty where it does not apply."""
    missing = value is None or (isinstance(value, float) and np.isnan(value))
    return "" if missing else str(value)


def _digits(row: Mapping[Hashable, Any]) -> int:
    return decimals_for(float(row["sigma"]), 3)


#: Columns that identify the observation of a row of residuals.parquet.
OBSERVATION = (
    text_of("group", "group", lambda row: group_words(row["group"])),
    text_of("image", "image", lambda row: _name(row["image"])),
    text_of("point", "point", lambda row: _name(row["point"])),
    text_of("component", "component"),
)
#: Its residual, σ and their unit.
RESIDUAL = (
    number_of("residual", "v", decimals=_digits, plus=True),
    number_of("sigma", "σ a priori", decimals=_digits),
    text_of("unit", "unit", lambda row: unit_words(row["unit"])),
)
