"""Residuals: rejected and uncontrolled observations, and the largest ones by group, by image and by strip.

The largest are listed whatever was rejected.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.row_table import Shown, number_of, omitted, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.quantities import group_words, observation_group, unit_words

MOST_REJECTED = 60
MOST_UNCONTROLLED = 40
MOST_IMAGES = 20
#: Rows of each group.
MOST_OF_GROUP = 8
#: Rows of lists with a row for each image; a page with more would be slow.
MOST_LISTED = 3000
_MDEG = 1e3
#: Group, columns, headings, unit, factor: what GNSS and INS say of each image.
_DIRECT = (
    ("gnss_positions", ("x", "y", "z"), "GNSS", "m", 1.0, 3),
    ("ins_attitudes", ("roll", "pitch", "yaw"), "INS", "mdeg", _MDEG, 1),
)
_OF_RAYS = (
    number_of("points", "image points"),
    number_of("rejected", "rejected"),
    number_of("rms_x_um", "RMS x", "µm", 2),
    number_of("rms_y_um", "RMS y", "µm", 2),
    number_of("largest_w", "largest |w|", decimals=2),
)


def rejected_table(material: Material) -> Table:
    """Rejected components, the largest |v|/σ first."""
    table = material.residuals
    rejected = table[table["status"] == "rejected"].copy()
    rejected["ratio"] = (rejected["residual"] / rejected["sigma"]).abs()
    rejected = rejected.sort_values("ratio", ascending=False, kind="stable")
    listed = rejected.head(MOST_REJECTED)
    note = omitted(listed, rejected, 'residuals.parquet (status "rejected")', largest=True)
    shown = (*_OBSERVATION, *_RESIDUAL, number_of("ratio", "|v|/σ", decimals=1))
    return table_of(
        "rejected", "Rejected components, the largest |v|/σ first", shown, listed, _observation_key, note
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
    shown = (*_OBSERVATION, number_of("redundancy", "redundancy number", decimals=3))
    return table_of("uncontrolled", "Other uncontrolled observations", shown, listed, _observation_key, note)


def _observation_key(row: Mapping[Hashable, Any]) -> str:
    """The key of a row of residuals.parquet."""
    return "|".join([str(row["group"]), _name(row["image"]), _name(row["point"]), str(row["component"])])


def _name(value: object) -> str:
    """The name of an image or point; empty where it does not apply."""
    missing = value is None or (isinstance(value, float) and np.isnan(value))
    return "" if missing else str(value)


def _digits(row: Mapping[Hashable, Any]) -> int:
    return decimals_for(float(row["sigma"]), 3)


#: Columns that identify the observation of a row of residuals.parquet.
_OBSERVATION = (
    text_of("group", "group", lambda row: group_words(row["group"])),
    text_of("image", "image", lambda row: _name(row["image"])),
    text_of("point", "point", lambda row: _name(row["point"])),
    text_of("component", "component"),
)
#: Its residual, σ and their unit.
_RESIDUAL = (
    number_of("residual", "v", decimals=_digits, plus=True),
    number_of("sigma", "σ a priori", decimals=_digits),
    text_of("unit", "unit", lambda row: unit_words(row["unit"])),
)


def worst_table(material: Material) -> Table:
    """The largest |w| of each group, of observations that were used and are controlled."""
    table = material.residuals
    size = table["standardized"].abs().where(table["status"] == "used")
    places = [
        place
        for _, own in size.groupby(table["group"].map(observation_group), sort=True)
        for place in own.dropna().nlargest(MOST_OF_GROUP).index
    ]
    chosen = table.loc[places].assign(strip=lambda rows: material.strips_of(rows["image"]))
    shown = (
        *_OBSERVATION,
        text_of("strip", "strip"),
        *_RESIDUAL,
        number_of("standardized", "w", decimals=2, plus=True),
    )
    note = (
        f"The {MOST_OF_GROUP} largest of each group among the observations not rejected; all in "
        "residuals.parquet. w = v / σ of v, for an a-priori σ0 of 1."
    )
    return table_of("worst-residuals", "Worst residuals by group", shown, chosen, _observation_key, note)


def residuals_by_image(material: Material) -> pd.DataFrame:
    """One row for each oriented image, by strip and name: the residuals of its observations.

    Columns: image, strip, points and rejected (image points), rms_x_um, rms_y_um, largest_w; gnss_x … gnss_z
    in metres and ins_roll … ins_yaw in millidegrees (adjusted − observed, rejected ones too), NaN without
    the observation; left_out, which of GNSS and INS was rejected.
    """
    rays = material.image_residuals
    # A point is rejected with both coordinates.
    every = material.residuals
    out = (every["group"] == IMAGE_POINTS) & (every["component"] == "x") & (every["status"] == "rejected")
    rejected = every.loc[out, "image"]
    used = rays[rays["used"]]
    squares = used.assign(
        x=used["vx_um"] ** 2, y=used["vy_um"] ** 2, w=used[["wx", "wy"]].abs().max(axis=1)
    ).groupby("image")
    of_rays = pd.DataFrame(
        {
            "points": squares.size(),
            "rms_x_um": np.sqrt(squares["x"].mean()),
            "rms_y_um": np.sqrt(squares["y"].mean()),
            "largest_w": squares["w"].max(),
        }
    )
    table = material.oriented[["image", "strip"]].merge(of_rays, on="image", how="left")
    table["points"] = table["points"].fillna(0).astype(int)
    table["rejected"] = table["image"].map(rejected.value_counts()).fillna(0).astype(int)
    images, left_out = pd.Index(table["image"]), [""] * len(table)
    for group, names, words, _, factor, _ in _DIRECT:
        own = every[every["group"] == group]
        row = images.get_indexer(pd.Index(own["image"]))
        column = pd.Index(names).get_indexer(pd.Index(own["component"]))
        of_image = (row >= 0) & (column >= 0)
        values = np.full((len(table), len(names)), np.nan)
        values[row[of_image], column[of_image]] = own["residual"].to_numpy(np.float64)[of_image] * factor
        table[[f"{words.lower()}_{name}" for name in names]] = values
        for k in np.unique(row[(own["status"] == "rejected").to_numpy() & (row >= 0)]).tolist():
            left_out[k] = f"{left_out[k]} {words}".strip()
    table["left_out"] = left_out
    return table


def image_table(by_image: pd.DataFrame) -> Table:
    """The residuals of each image."""
    shown = (
        text_of("image", "image"),
        text_of("strip", "strip"),
        *_OF_RAYS,
        *_direct("{}", "v {} {}", plus=True),
        text_of("left_out", "GNSS, INS rejected"),
    )
    listed = by_image.head(MOST_LISTED)
    note = omitted(listed, by_image, "residuals.parquet")
    return table_of("image-list", "Residuals by image", shown, listed, "{image}", note)


def strip_tables(by_image: pd.DataFrame) -> tuple[Table, Table]:
    """Image points, and means and root mean squares of GNSS and INS residuals, of each strip."""
    strips = by_image.assign(
        square_x=by_image["rms_x_um"] ** 2 * by_image["points"],
        square_y=by_image["rms_y_um"] ** 2 * by_image["points"],
    ).groupby("strip", sort=True)
    sums = strips[["points", "rejected", "square_x", "square_y"]].sum()
    points = sums["points"].where(sums["points"] > 0)
    table = sums.assign(
        images=strips.size(),
        rms_x_um=np.sqrt(sums["square_x"] / points),
        rms_y_um=np.sqrt(sums["square_y"] / points),
        largest_w=strips["largest_w"].max(),
    ).reset_index()
    shown = (text_of("strip", "strip"), number_of("images", "images"), *_OF_RAYS)
    image_points = table_of("strip-list", "Residuals of image points by strip", shown, table, "{strip}")
    return image_points, _strip_directs(by_image)


def _strip_directs(by_image: pd.DataFrame) -> Table:
    names = [name for name, *_ in _direct_names()]
    grouped = by_image.groupby("strip", sort=True)[names]
    square = (by_image[names] ** 2).groupby(by_image["strip"], sort=True).mean()
    table = grouped.mean().add_prefix("mean_").join((square**0.5).add_prefix("rms_"))
    table["images"] = grouped.count().max(axis=1)
    shown = (
        text_of("strip", "strip"),
        number_of("images", "images"),
        *_direct("mean_{}", "mean {} {}", plus=True),
        *_direct("rms_{}", "RMS {} {}"),
    )
    note = (
        "Adjusted − observed, for all observations, including rejected ones. A mean far from zero indicates "
        "a shift of the strip."
    )
    observed = table[table["images"] > 0].reset_index()
    return table_of(
        "strip-direct-list", "Residuals of GNSS and INS by strip", shown, observed, "{strip}", note
    )


def _direct_names() -> list[tuple[str, str, str, str, int]]:
    """Column, GNSS or INS, component, unit and decimals."""
    return [
        (f"{words.lower()}_{name}", words, name, unit, decimals)
        for _, names, words, unit, _, decimals in _DIRECT
        for name in names
    ]


def _direct(pattern: str, heading: str, *, plus: bool = False) -> tuple[Shown, ...]:
    """Columns of what GNSS and INS say of each image; the patterns take the column, and its words."""
    return tuple(
        number_of(pattern.format(column), heading.format(words, name), unit, decimals, plus=plus)
        for column, words, name, unit, decimals in _direct_names()
    )
