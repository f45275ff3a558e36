"""Tables of the page about image quality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import pandas as pd

from tasks.document_kit.table import Column, Number, Row, Table, text_column
from tasks.documents.image_quality.material import SceneMaterial


def mean_table(material: SceneMaterial) -> Table:
    """Factors by band, direction and zone."""
    columns = (
        Column("band", "band"),
        text_column("direction", "along"),
        text_column("zone", "zone"),
        Column("edges", "edges"),
        Column("left_out", "left out"),
        Column("factor", "factor"),
        Column("sigma_factor", "σ"),
        Column("scatter", "scatter of an edge"),
        Column("stated", "stated σ of an edge"),
        Column("effective_gsd_m", "effective GSD", "m"),
        Column("mtf50", "MTF50", "1/px"),
        Column("mtf_nyquist", "MTF at Nyquist"),
        Column("overshoot", "overshoot", "%"),
        text_column("sharpened", "sharpened"),
    )
    rows = tuple(
        Row(
            f"{row['band']}:{row['direction']}:{row['zone']}",
            (
                Number(row["band"]),
                str(row["direction"]),
                str(row["zone"]),
                Number(row["edges"]),
                Number(row["left_out"]),
                Number(row["factor"], 3),
                Number(row["sigma_factor"], 3),
                Number(row["scatter"], 3),
                Number(row["stated"], 3),
                Number(row["effective_gsd_m"], 4),
                Number(row["mtf50"], 3),
                Number(row["mtf_nyquist"], 3),
                Number(100.0 * row["overshoot"], 1),
                "yes" if row["sharpened"] else "no",
            ),
        )
        for _, row in material.means.iterrows()
    )
    note = (
        "Factor: full width at half maximum of the line spread function in pixels, 1 for a sharp image. MTF "
        "is the response across the edges following ISO 12233, including the pixel."
    )
    return Table("means", "Effective resolution", columns, rows, note)


def drift_table(drift: pd.DataFrame) -> Table:
    """Change of the factors since an earlier date."""
    columns = (
        Column("band", "band"),
        text_column("direction", "along"),
        text_column("zone", "zone"),
        Column("earlier", "earlier factor"),
        Column("factor", "now"),
        Column("change", "change"),
        Column("sigma_change", "σ"),
        Column("t", "in σ"),
        text_column("drifted", "drifted"),
    )
    rows = tuple(
        Row(
            f"{row['band']}:{row['direction']}:{row['zone']}",
            (
                Number(row["band"]),
                str(row["direction"]),
                str(row["zone"]),
                Number(row["earlier"], 3),
                Number(row["factor"], 3),
                Number(row["change"], 3, plus=True),
                Number(row["sigma_change"], 3),
                Number(row["t"], 1, plus=True),
                "yes" if row["drifted"] else "no",
            ),
        )
        for _, row in drift.iterrows()
    )
    return Table("drift", "Change of the factors since the earlier date", columns, rows)


def change_table(changes: pd.DataFrame) -> Table:
    """Change of other quantities since an earlier date."""
    columns = (
        text_column("quantity", "quantity"),
        Column("band", "band"),
        Column("earlier", "then"),
        Column("value", "now"),
        Column("change", "change"),
        Column("sigma_change", "σ"),
        Column("t", "in σ"),
        text_column("drifted", "drifted"),
    )
    rows = tuple(
        Row(
            f"{row['band']}:{row['quantity']}",
            (
                str(row["quantity"]).replace("_", " "),
                Number(row["band"]),
                *(Number(row[name], 3) for name in ("earlier", "value")),
                Number(row["change"], 3, plus=True),
                Number(row["sigma_change"], 3),
                Number(row["t"], 1, plus=True),
                "yes" if row["drifted"] else "no",
            ),
        )
        for _, row in changes.iterrows()
    )
    note = "Defects: σ is √(new + gone), since a pixel near its limit appears and disappears equally often."
    return Table(
        "changes", "Change of noise, sensitivity and defects since the earlier date", columns, rows, note
    )


def smear_table(material: SceneMaterial) -> Table:
    """Blur of different directions as a smear."""
    columns = (
        text_column("image", "image"),
        Column("band", "band"),
        Column("edges", "edges"),
        Column("length_px", "length", "px"),
        Column("sigma_length_px", "σ"),
        Column("direction_deg", "direction", "°"),
        Column("sigma_direction_deg", "σ"),
        text_column("significant", "significant"),
    )
    decimals = {"length_px": 2, "sigma_length_px": 2, "direction_deg": 0, "sigma_direction_deg": 0}
    rows = tuple(
        Row(
            f"{row['image']}:{row['band']}",
            (
                str(row["image"]),
                Number(row["band"]),
                Number(row["edges"]),
                *(Number(row[name], digits) for name, digits in decimals.items()),
                "yes" if row["significant"] else "no",
            ),
        )
        for _, row in material.smears.iterrows()
    )
    return Table("smears", "Blur by direction, interpreted as a smear", columns, rows)


def motion_table(compared: pd.DataFrame) -> Table:
    """Smear from the movement of the camera and from the edges."""
    columns = (
        text_column("image", "image"),
        Column("band", "band"),
        Column("expected_px", "from the trajectory", "px"),
        Column("sigma_expected_px", "σ"),
        Column("expected_deg", "direction", "°"),
        Column("found_px", "from the edges", "px"),
        Column("sigma_found_px", "σ"),
        Column("found_deg", "direction", "°"),
        Column("sigma_found_deg", "σ"),
        Column("probability", "probability"),
        text_column("contradicts", "agree"),
    )
    decimals = (2, 2, 0, 2, 2, 0, 0, 3)
    rows = tuple(
        Row(
            f"{row['image']}:{row['band']}",
            (
                str(row["image"]),
                Number(row["band"]),
                *(Number(row[at.name], places) for at, places in zip(columns[2:-1], decimals, strict=True)),
                "no" if row["contradicts"] else "yes",
            ),
        )
        for _, row in compared.iterrows()
    )
    note = "Probability of such a difference by chance; below 0.001 the two contradict each other."
    return Table("motion", "Smear from the movement of the camera and from the edges", columns, rows, note)


def refused_table(material: SceneMaterial) -> Table:
    """Why candidates were not taken."""
    columns = (text_column("reason", "reason"), Column("count", "candidates"))
    refused = cast(Mapping[str, int], material.figures["refused"])
    rows = tuple(Row(reason, (reason, Number(count))) for reason, count in refused.items())
    return Table("refused", "Rejected candidates", columns, rows)


def noise_table(material: SceneMaterial) -> Table:
    """Noise by grey level."""
    columns = (
        text_column("image", "image"),
        Column("band", "band"),
        Column("level", "grey value"),
        Column("noise", "noise"),
        Column("sigma_noise", "σ"),
        Column("signal_to_noise", "signal / noise"),
        Column("tiles", "areas"),
    )
    rows = tuple(
        Row(
            f"{row['image']}:{row['band']}:{row['level']}",
            (
                str(row["image"]),
                Number(row["band"]),
                Number(row["level"], 1),
                Number(row["noise"], 2),
                Number(row["sigma_noise"], 2),
                Number(row["signal_to_noise"], 1),
                Number(row["tiles"]),
            ),
        )
        for _, row in material.noise.iterrows()
    )
    return Table("noise", "Noise in homogeneous areas, grey values", columns, rows)
