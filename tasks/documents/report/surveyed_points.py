"""Control and check points: differences computed − given, in metres, in GSD and against their σ."""

from __future__ import annotations

from typing import Any

from tasks.document_kit.row_table import number_of, numbers_of, omitted, table_of, text_of
from tasks.document_kit.table import Row, Table, components, text_column
from tasks.documents.report.material import Material
from tasks.documents.report.surveyed_differences import (
    AXES,
    HEADINGS,
    LEFT_OUT,
    STATISTICS_COLUMNS,
    difference_statistics,
    known_differences,
    ratio_to_sigma,
)
from tasks.results.summary import CheckPointTest

MOST_ROWS = 100


POINT = text_of("point", "point")
DIFFERENCES = (
    *numbers_of("{}_m", [f"d {h}" for h in HEADINGS], "m", AXES, 3, plus=True),
    *numbers_of("sigma_{}_m", [f"σ {h}" for h in HEADINGS], "m", AXES, 3),
    *numbers_of("{}_gsd", [f"d {h}" for h in HEADINGS], "GSD", AXES, 2, plus=True),
    *numbers_of("{}_ratio", [f"|d|/σ {h}" for h in HEADINGS], "", AXES, 1),
    number_of("rays", "rays"),
)
_OF_CONTROL = (
    text_of("status", "status"),
    *numbers_of(
        "loo_{}_m",
        [f"without it, d {h}" for h in HEADINGS],
        "m",
        AXES,
        3,
        plus=True,
        of=f"{LEFT_OUT}{{}}_m",
    ),
    number_of("loo_largest", "without it, |d|/σ", decimals=1, of=f"{LEFT_OUT}largest"),
)
_COORDINATE = (
    text_of("way", "", "heading"),
    number_of("points", "points"),
    number_of("rms", "RMS", "m", 3, of="rmse_m"),
    number_of("predicted", "predicted RMS", "m", 3, of="predicted_rmse_m"),
    number_of("low", "limits, from", "m", 3, of="predicted_low_m"),
    number_of("high", "to", "m", 3, of="predicted_high_m"),
    number_of("ratio", "RMS/predicted", decimals=2),
    number_of("degrees", "degrees of freedom", decimals=1, of="degrees_of_freedom"),
    number_of("mean", "mean", "m", 3, plus=True, of="mean_m"),
    number_of("mean_limit", "its limit ±", "m", 3, of="mean_limit_m"),
    text_of("verdict", "verdict"),
)


def point_table(material: Material, is_check: bool) -> Table:
    """One row for each point, the largest |d|/σ first."""
    table = material.differences(is_check).sort_values("largest", ascending=False, kind="stable")
    listed = table.head(MOST_ROWS)
    kind = "check points" if is_check else "control points"
    file = "check_points.parquet" if is_check else "control_residuals.parquet"
    shown = (POINT, *DIFFERENCES, *(() if is_check else _OF_CONTROL))
    caption = f"{kind.capitalize()}, the largest |d|/σ first"
    note = omitted(listed, table, file, largest=True)
    return table_of(kind.replace(" ", "-"), caption, shown, listed, "{point}", note)


def statistics(material: Material) -> Table:
    """Mean, root mean square and largest difference of control and of check points, in metres and in GSD."""
    rows = []
    for key, kind, is_check, prefix in _KINDS:
        table = material.differences(is_check)
        table = table if is_check else table[table["status"] == "used"]
        if len(table) == 0:
            continue
        counted = known_differences(table, prefix)
        rows += [
            Row(f"{key}:{name}", (f"{kind}, {words}", *cells, *counted))
            for name, words, cells in difference_statistics(table, prefix)
        ]
    columns = (
        text_column("figure", "figure"),
        *STATISTICS_COLUMNS,
        *components("{}_count", [f"n {h}" for h in HEADINGS], "", AXES),
    )
    caption = "Differences at control and check points"
    return Table("surveyed-statistics", caption, columns, tuple(rows), _folds(material))


def distance_table(material: Material) -> Table:
    """One row for each distance between object points, check distances first, then the largest |d|/σ."""
    table = material.distance_residuals.copy()
    table["ratio"] = ratio_to_sigma(table, "difference_m")
    table = table.sort_values(["status", "ratio"], ascending=[True, False], kind="stable")
    listed = table.head(MOST_ROWS)
    shown = (
        text_of("point", "from"),
        text_of("other_point", "to"),
        text_of("status", "status"),
        number_of("distance", "distance", "m", 5, of="distance_m"),
        number_of("difference", "d", "mm", 3, plus=True, factor=1e3, of="difference_m"),
        number_of("sigma", "σ of d", "mm", 3, factor=1e3, of="sigma_difference_m"),
        number_of("ratio", "|d|/σ", decimals=1),
    )
    note = omitted(listed, table, "distance_residuals.parquet")
    caption = "Distances, computed − given"
    return table_of("distances", caption, shown, listed, "{point}:{other_point}", note)


def check_test_table(material: Material) -> Table:
    """Check points compared with the values expected from their σ, a row for each coordinate."""
    found = material.summary.check_point_test
    rows = [] if found is None else [_coordinate(found, k) for k in range(3) if found.points[k]]
    note = (
        ""
        if found is None
        else f"All limits together hold with a probability of {100 * found.confidence:g} %."
    )
    caption = "Check points against their predicted σ"
    return table_of("check-point-test", caption, _COORDINATE, rows, "{heading}", note)


def _coordinate(found: CheckPointTest, k: int) -> dict[str, Any]:
    """One coordinate of the test: its figures, and what they say."""
    own = {name: values[k] for name, values in found if isinstance(values, tuple)}
    beyond = own["rmse_m"] > own["predicted_high_m"] or abs(own["mean_m"]) > own["mean_limit_m"]
    smaller = "smaller than expected" if own["rmse_m"] < own["predicted_low_m"] else "as expected"
    return {**own, "heading": HEADINGS[k], "verdict": "beyond its limits" if beyond else smaller}


def _folds(material: Material) -> str:
    """A sentence about control points left out a fold at a time; empty where that was not requested."""
    found = material.figures.k_fold
    if found is None:
        return ""
    each = ", ".join("–" if value is None else f"{value:.3f}" for value in found.rmse_m)
    return (
        f"Control points, left out in {found.folds} folds, each over the whole area: "
        f"RMS {each} m (x, y, z) at {found.points} points."
    )


_KINDS = (
    ("control", "control points", False, ""),
    ("left-out", "control points, each left out", False, LEFT_OUT),
    ("check", "check points", True, ""),
)
