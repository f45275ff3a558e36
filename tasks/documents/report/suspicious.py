"""Rejected and uncontrolled observations."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.table import Column, Row, Table, decimals_for, numbers, text_column
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
    shown = rejected.head(MOST_REJECTED)
    note = ""
    if len(shown) < len(rejected):
        note = f'The {len(shown)} largest of {len(rejected):,}; all in residuals.parquet (status "rejected").'
    columns = (
        *observation_columns(),
        Column("residual", "v"),
        Column("sigma", "σ a priori"),
        text_column("unit", "unit"),
        Column("ratio", "|v|/σ"),
    )
    rows = tuple(
        Row(
            observation_key(row),
            (
                *observation(row),
                *numbers((row["residual"],), decimals_for(float(row["sigma"]), 3), plus=True),
                *numbers((row["sigma"],), decimals_for(float(row["sigma"]), 3)),
                unit_words(str(row["unit"])),
                *numbers((row["ratio"],), 1),
            ),
        )
        for row in shown.to_dict("records")
    )
    return Table("rejected", "Rejected components, the largest |v|/σ first", columns, rows, note)


def uncontrolled_images(material: Material) -> Table:
    """Images with the most uncontrolled image coordinates."""
    table = material.residuals
    took_part = (table["group"] == IMAGE_POINTS) & table["status"].isin(["used", "uncontrolled"])
    own = table.loc[took_part, ["image", "status"]]
    counted = (
        pd.DataFrame({"image": own["image"], "uncontrolled": own["status"] == "uncontrolled"})
        .groupby("image")["uncontrolled"]
        .agg(["sum", "size"])
    )
    counted = counted[counted["sum"] > 0].sort_values("sum", ascending=False, kind="stable")
    shown = counted.head(MOST_IMAGES)
    note = "" if len(shown) == len(counted) else f"The {len(shown)} images with the most of {len(counted):,}."
    columns = (
        text_column("image", "image"),
        Column("uncontrolled", "uncontrolled coordinates"),
        Column("coordinates", "of"),
        Column("share", "share", "%"),
    )
    rows = tuple(
        Row(str(name), (str(name), *numbers((few, all_), 0), *numbers((100.0 * few / all_,), 1)))
        for name, few, all_ in zip(shown.index, shown["sum"], shown["size"], strict=True)
    )
    return Table("uncontrolled-images", "Uncontrolled image coordinates by image", columns, rows, note)


def uncontrolled_table(material: Material) -> Table:
    """Uncontrolled observations other than image points, the least redundancy first."""
    table = material.residuals
    others = table[(table["status"] == "uncontrolled") & (table["group"] != IMAGE_POINTS)]
    others = others.sort_values("redundancy", kind="stable")
    shown = others.head(MOST_UNCONTROLLED)
    note = (
        ""
        if len(shown) == len(others)
        else f"The first {len(shown)} of {len(others):,}; all in residuals.parquet."
    )
    rows = tuple(
        Row(observation_key(row), (*observation(row), *numbers((row["redundancy"],), 3)))
        for row in shown.to_dict("records")
    )
    columns = (*observation_columns(), Column("redundancy", "redundancy number"))
    return Table("uncontrolled", "Other uncontrolled observations", columns, rows, note)


def observation_columns() -> tuple[Column, ...]:
    """Columns that identify the observation of a row."""
    return (
        text_column("group", "group"),
        text_column("image", "image"),
        text_column("point", "point"),
        text_column("component", "component"),
    )


def observation(row: Mapping[Hashable, Any]) -> tuple[str, ...]:
    """Its cells in these columns."""
    return (group_words(str(row["group"])), _name(row["image"]), _name(row["point"]), str(row["component"]))


def observation_key(row: Mapping[Hashable, Any]) -> str:
    """The key of a row of residuals.parquet."""
    return "|".join([str(row["group"]), _name(row["image"]), _name(row["point"]), str(row["component"])])


def _name(value: object) -> str:
    """The name of an image or point; empty where it does not apply."""
    missing = value is None or (isinstance(value, float) and np.isnan(value))
    return "" if missing else str(value)
