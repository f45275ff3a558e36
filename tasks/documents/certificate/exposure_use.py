"""Which exposures were used, which were not, and why."""

from __future__ import annotations

import pandas as pd

from tasks.document_kit.table import Column, Number, Row, Table, text_column
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.material import IMAGE_POINTS, TOOK_PART

_MOST_NAMES = 12
# An image of fewer points is oriented by GNSS and INS almost alone.
_FEW_POINTS = 6
_ALWAYS = ("delivered", "used", "not_used")
_OBSERVED = (("gnss_positions", "GNSS position"), ("ins_attitudes", "INS attitude"))


def exposure_table(material: CertificateMaterial) -> Table:
    """Delivered and used exposures, and how many are not used or lack something, for which reason."""
    results, names = material.results, material.record.names
    delivered = material.exposures[material.exposures["camera"].isin(names)]["image"]
    oriented = set(material.images["image"])
    in_block = set(results.images["image"])
    measured = set(results.image_points["image"])
    out = [name for name in delivered if name not in oriented]
    rows = [
        _row("delivered", "delivered", delivered, named=False),
        _row("used", "used", [name for name in delivered if name in oriented], named=False),
        _row("not_used", "not used", out, named=False),
        _row(
            "without_points",
            "not used: no image point is measured in it",
            [n for n in out if n not in measured],
        ),
        _row(
            "without_orientation",
            "not used: incomplete, and cannot be oriented by its image points",
            [name for name in out if name in measured and name not in in_block],
        ),
        _row(
            "not_adjusted",
            "not used: not oriented by the adjustment",
            [name for name in out if name in in_block],
        ),
        _row("few_points", f"used with fewer than {_FEW_POINTS} image points", _few(material)),
    ]
    for group, words in _OBSERVED:
        of_group = results.residuals[results.residuals["group"] == group]
        rejected = set(of_group.loc[of_group["status"] == "rejected", "image"])
        lacking = set(of_group.loc[~of_group["status"].isin((*TOOK_PART, "rejected")), "image"])
        observed = set(of_group["image"]) - lacking
        used = [name for name in delivered if name in oriented]
        if material.record.heads:
            # An event is observed once, which is listed under one of its images.
            used = [name for name in used if name in set(of_group["image"])]
        rows += [
            _row(
                f"{group}_rejected",
                f"used, {words} rejected as gross error",
                [name for name in used if name in rejected],
            ),
            _row(
                f"{group}_missing",
                f"used without {words}",
                [name for name in used if name not in observed and name not in rejected],
            ),
        ]
    columns = (
        text_column("use", "exposures"),
        Column("count", "number"),
        text_column("names", "which"),
    )
    # A reason without an exposure says nothing.
    shown = tuple(row for row in rows if row.key in _ALWAYS or row.cells[2])
    return Table("exposures", "Exposures used and not used", columns, shown)


def _few(material: CertificateMaterial) -> list[str]:
    """Oriented images with few points that were used."""
    own = material.results.residuals
    own = own[(own["group"] == IMAGE_POINTS) & (own["component"] == "x") & own["status"].isin(TOOK_PART)]
    counts = own.groupby("image")["point"].size()
    return [name for name in material.images["image"] if counts.get(name, 0) < _FEW_POINTS]


def _row(key: str, words: str, names: pd.Series | list[str], *, named: bool = True) -> Row:
    listed = sorted(names)
    text = ", ".join(listed[:_MOST_NAMES]) if named else ""
    if named and len(listed) > _MOST_NAMES:
        text += f" and {len(listed) - _MOST_NAMES:,} more"
    return Row(key, (words, Number(len(listed)), text))
