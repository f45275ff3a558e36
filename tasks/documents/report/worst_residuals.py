"""Residuals by group, by image and by strip: always the largest ones, whatever was rejected."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.documents.report.suspicious import observation, observation_columns, observation_key
from tasks.quantities import unit_words

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


def worst_table(material: Material) -> Table:
    """The largest |w| of each group, of observations that were used and are controlled."""
    table = material.residuals
    size = table["standardized"].abs().where(table["status"] == "used")
    places = [
        place
        for _, own in size.groupby(table["group"], sort=True)
        for place in own.dropna().nlargest(MOST_OF_GROUP).index
    ]
    chosen = table.loc[places].assign(strip=lambda rows: material.strips_of(rows["image"]))
    columns = (
        *observation_columns(),
        text_column("strip", "strip"),
        Column("residual", "v"),
        Column("sigma", "σ a priori"),
        text_column("unit", "unit"),
        Column("standardized", "w"),
    )
    rows = tuple(_worst_row(row) for row in chosen.to_dict("records"))
    note = (
        f"The {MOST_OF_GROUP} largest of each groupamong the observations not rejected; all in "
        "residuals.parquet. w = v / σ of v, for an a-priori σ0 of 1."
    )
    return Table("worst-residuals", "Worst residuals by group", columns, rows, note)


def _worst_row(row: Mapping[Hashable, Any]) -> Row:
    sigma = float(row["sigma"])
    return Row(
        observation_key(row),
        (
            *observation(row),
            str(row["strip"]),
            Number(float(row["residual"]), decimals_for(sigma, 3), plus=True),
            Number(sigma, decimals_for(sigma, 3)),
            unit_words(str(row["unit"])),
            Number(float(row["standardized"]), 2, plus=True),
        ),
    )


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
    left_out = pd.Series("", index=table.index)
    for group, names, words, _, factor, _ in _DIRECT:
        own = material.residuals[material.residuals["group"] == group]
        for name in names:
            values = own[own["component"] == name].set_index("image")["residual"] * factor
            table[f"{words.lower()}_{name}"] = table["image"].map(values)
        out = table["image"].isin(own.loc[own["status"] == "rejected", "image"])
        left_out = left_out.where(~out, left_out + " " + words)
    table["left_out"] = left_out.str.strip()
    return table


def image_table(by_image: pd.DataFrame) -> Table:
    """The residuals of each image."""
    columns = (
        text_column("image", "image"),
        text_column("strip", "strip"),
        Column("points", "image points"),
        Column("rejected", "rejected"),
        Column("rms_x_um", "RMS x", "µm"),
        Column("rms_y_um", "RMS y", "µm"),
        Column("largest_w", "largest |w|"),
        *_direct_columns("{}", "v {} {}"),
        text_column("left_out", "GNSS, INS rejected"),
    )
    listed = by_image.head(MOST_LISTED)
    shown = [
        *((name, 0, False) for name in ("points", "rejected")),
        *((name, 2, False) for name in ("rms_x_um", "rms_y_um", "largest_w")),
        *((name, decimals, True) for name, _, _, _, decimals in _direct_names()),
    ]
    rows = tuple(
        Row(image, (image, strip, *values, left_out))
        for image, strip, left_out, *values in zip(
            *(listed[name].tolist() for name in ("image", "strip", "left_out")),
            *(numbers(listed[name].tolist(), decimals, plus=plus) for name, decimals, plus in shown),
            strict=True,
        )
    )
    return Table(
        "image-list", "Residuals by image", columns, rows, listed_note(by_image, "residuals.parquet")
    )


def strip_tables(by_image: pd.DataFrame) -> tuple[Table, Table]:
    """Image points, and means and root mean squares of GNSS and INS residuals, of each strip."""
    strips = by_image.assign(
        square_x=by_image["rms_x_um"] ** 2 * by_image["points"],
        square_y=by_image["rms_y_um"] ** 2 * by_image["points"],
    ).groupby("strip", sort=True)
    sums = strips[["points", "rejected", "square_x", "square_y"]].sum()
    points = sums["points"].to_numpy(np.float64)
    rms = np.sqrt(
        sums[["square_x", "square_y"]].to_numpy(np.float64) / np.where(points, points, np.nan)[:, None]
    )
    images, largest = strips.size(), strips["largest_w"].max()
    of_rays = tuple(
        Row(
            str(name),
            (
                str(name),
                Number(float(images[name])),
                Number(float(points[k])),
                Number(float(sums["rejected"].iloc[k])),
                *(Number(float(value), 2) for value in (*rms[k], largest[name])),
            ),
        )
        for k, name in enumerate(sums.index)
    )
    columns = (
        text_column("strip", "strip"),
        Column("images", "images"),
        Column("points", "image points"),
        Column("rejected", "rejected"),
        Column("rms_x_um", "RMS x", "µm"),
        Column("rms_y_um", "RMS y", "µm"),
        Column("largest_w", "largest |w|"),
    )
    image_points = Table("strip-list", "Residuals of image points by strip", columns, of_rays)
    return image_points, _strip_directs(by_image)


def _strip_directs(by_image: pd.DataFrame) -> Table:
    names = [name for name, *_ in _direct_names()]
    grouped = by_image.groupby("strip", sort=True)[names]
    mean, number = grouped.mean(), grouped.count()
    square = (by_image[names] ** 2).groupby(by_image["strip"], sort=True).mean()
    rows = tuple(
        Row(
            str(strip),
            (
                str(strip),
                Number(float(number.loc[strip].max())),
                *_direct_numbers(mean.loc[strip].to_dict()),
                *_direct_numbers(np.sqrt(square.loc[strip]).to_dict(), plus=False),
            ),
        )
        for strip in mean.index
        if number.loc[strip].max() > 0
    )
    columns = (
        text_column("strip", "strip"),
        Column("images", "images"),
        *_direct_columns("mean_{}", "mean {} {}"),
        *_direct_columns("rms_{}", "RMS {} {}"),
    )
    note = (
        "Adjusted − observed, for all observations, including rejected ones. A mean far from zero indicates "
        "a shift of the strip."
    )
    return Table("strip-direct-list", "Residuals of GNSS and INS by strip", columns, rows, note)


def listed_note(table: pd.DataFrame, file: str) -> str:
    """A note on what a list with a row for each image omits."""
    return "" if len(table) <= MOST_LISTED else f"The first {MOST_LISTED:,} of {len(table):,}; all in {file}."


def _direct_names() -> list[tuple[str, str, str, str, int]]:
    """Column, GNSS or INS, component, unit and decimals."""
    return [
        (f"{words.lower()}_{name}", words, name, unit, decimals)
        for _, names, words, unit, _, decimals in _DIRECT
        for name in names
    ]


def _direct_columns(pattern: str, heading: str) -> tuple[Column, ...]:
    return tuple(
        Column(pattern.format(column), heading.format(words, name), unit)
        for column, words, name, unit, _ in _direct_names()
    )


def _direct_numbers(row: Mapping[Hashable, Any], *, plus: bool = True) -> tuple[Number, ...]:
    return tuple(Number(float(row[column]), decimals, plus) for column, _, _, _, decimals in _direct_names())
