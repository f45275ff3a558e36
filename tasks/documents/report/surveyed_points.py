"""Control and check points: differences computed − given, in metres, in GSD and against their σ."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.document_kit.table import Column, Number, Row, Table, components, numbers, text_column
from tasks.documents.report.material import Material
from tasks.documents.report.surveyed_differences import AXES, LEFT_OUT
from tasks.results.summary import CheckPointTest

_HEADINGS = ("east", "north", "up")
MOST_ROWS = 100


_LEFT_OUT_COLUMNS = (
    *components("loo_{}_m", [f"without it, d {h}" for h in _HEADINGS], "m", AXES),
    Column("loo_largest", "without it, |d|/σ"),
)


def point_table(material: Material, is_check: bool) -> Table:
    """One row for each point, the largest |d|/σ first."""
    table = material.differences(is_check).sort_values("largest", ascending=False, kind="stable")
    shown = table.head(MOST_ROWS)
    kind = "check points" if is_check else "control points"
    file = "check_points.parquet" if is_check else "control_residuals.parquet"
    note = "" if len(shown) == len(table) else f"The {len(shown)} largest of {len(table):,}; all in {file}."
    columns = (
        text_column("point", "point"),
        *components("{}_m", [f"d {h}" for h in _HEADINGS], "m", AXES),
        *components("sigma_{}_m", [f"σ {h}" for h in _HEADINGS], "m", AXES),
        *components("{}_gsd", [f"d {h}" for h in _HEADINGS], "GSD", AXES),
        *components("{}_ratio", [f"|d|/σ {h}" for h in _HEADINGS], "", AXES),
        Column("rays", "rays"),
        *(() if is_check else (text_column("status", "status"), *_LEFT_OUT_COLUMNS)),
    )
    rows = tuple(
        Row(
            str(row["point"]),
            (
                str(row["point"]),
                *numbers((row[f"{axis}_m"] for axis in AXES), 3, plus=True),
                *numbers((row[f"sigma_{axis}_m"] for axis in AXES), 3),
                *numbers((row[f"{axis}_gsd"] for axis in AXES), 2, plus=True),
                *numbers((row[f"{axis}_ratio"] for axis in AXES), 1),
                *numbers((row["rays"],), 0),
                *(() if is_check else (str(row["status"]),)),
                *(() if is_check else numbers((row[f"{LEFT_OUT}{axis}_m"] for axis in AXES), 3, plus=True)),
                *(() if is_check else numbers((row[f"{LEFT_OUT}largest"],), 1)),
            ),
        )
        for row in shown.to_dict("records")
    )
    return Table(
        f"{kind.replace(' ', '-')}", f"{kind.capitalize()}, the largest |d|/σ first", columns, rows, note
    )


def statistics(material: Material) -> Table:
    """Mean, root mean square and largest difference of control and of check points, in metres and in GSD."""
    rows = []
    for key, kind, is_check, prefix in _KINDS:
        table = material.differences(is_check)
        table = table if is_check else table[table["status"] == "used"]
        if len(table) == 0:
            continue
        for name, words, figure in _FIGURES:
            metres = [_of(table[f"{prefix}{axis}_m"], figure) for axis in AXES]
            in_gsd = [_of(table[f"{prefix}{axis}_gsd"], figure) for axis in AXES]
            counted = numbers((float(table[f"{prefix}{axis}_m"].notna().sum()) for axis in AXES), 0)
            plus = name == "mean"
            cells = (*numbers(metres, 3, plus=plus), *numbers(in_gsd, 2, plus=plus), *counted)
            rows.append(Row(f"{key}:{name}", (f"{kind}, {words}", *cells)))
    columns = (
        text_column("figure", "figure"),
        *components("{}_m", _HEADINGS, "m", AXES),
        *components("{}_gsd", _HEADINGS, "GSD", AXES),
        *components("{}_count", [f"n {h}" for h in _HEADINGS], "", AXES),
    )
    caption = "Differences at control and check points"
    return Table("surveyed-statistics", caption, columns, tuple(rows), _folds(material))


def distance_table(material: Material) -> Table:
    """One row for each distance between object points, check distances first, then the largest |d|/σ."""
    table = material.distance_residuals.copy()
    d, sigma = (table[name].to_numpy(np.float64) for name in ("difference_m", "sigma_difference_m"))
    table["ratio"] = np.divide(np.abs(d), sigma, out=np.full(len(d), np.nan), where=sigma > 0)
    table = table.sort_values(["status", "ratio"], ascending=[True, False], kind="stable")
    shown = table.head(MOST_ROWS)
    note = (
        ""
        if len(shown) == len(table)
        else f"The first {len(shown)} of {len(table):,}; all in distance_residuals.parquet."
    )
    columns = (
        text_column("point", "from"),
        text_column("other_point", "to"),
        text_column("status", "status"),
        Column("distance", "distance", "m"),
        Column("difference", "d", "mm"),
        Column("sigma", "σ of d", "mm"),
        Column("ratio", "|d|/σ"),
    )
    rows = tuple(
        Row(
            f"{row['point']}:{row['other_point']}",
            (
                str(row["point"]),
                str(row["other_point"]),
                str(row["status"]),
                *numbers((row["distance_m"],), 5),
                *numbers((1e3 * row["difference_m"],), 3, plus=True),
                *numbers((1e3 * row["sigma_difference_m"],), 3),
                *numbers((row["ratio"],), 1),
            ),
        )
        for row in shown.to_dict("records")
    )
    return Table("distances", "Distances, computed − given", columns, rows, note)


def check_test_table(material: Material) -> Table:
    """Check points compared with the values expected from their σ, a row for each coordinate."""
    found = material.summary.check_point_test
    columns = (
        text_column("way", ""),
        Column("points", "points"),
        Column("rms", "RMS", "m"),
        Column("predicted", "predicted RMS", "m"),
        Column("low", "limits, from", "m"),
        Column("high", "to", "m"),
        Column("ratio", "RMS/predicted"),
        Column("degrees", "degrees of freedom"),
        Column("mean", "mean", "m"),
        Column("mean_limit", "its limit ±", "m"),
        text_column("verdict", "verdict"),
    )
    rows = () if found is None else tuple(_test_row(found, k) for k in range(3) if found.points[k])
    note = (
        ""
        if found is None
        else f"All limits together hold with a probability of {100 * found.confidence:g} %."
    )
    return Table("check-point-test", "Check points against their predicted σ", columns, rows, note)


def _test_row(found: CheckPointTest, k: int) -> Row:
    """One coordinate of the test."""
    rms, low, high = (
        float(one[k] or 0.0) for one in (found.rmse_m, found.predicted_low_m, found.predicted_high_m)
    )
    beyond = rms > high or abs(found.mean_m[k] or 0.0) > (found.mean_limit_m[k] or 0.0)
    metres = (found.rmse_m[k], found.predicted_rmse_m[k], low, high)
    return Row(
        _HEADINGS[k],
        (
            _HEADINGS[k],
            Number(found.points[k]),
            *numbers(metres, 3),
            Number(found.ratio[k], 2),
            Number(found.degrees_of_freedom[k], 1),
            *numbers((found.mean_m[k],), 3, plus=True),
            Number(found.mean_limit_m[k], 3),
            "beyond its limits" if beyond else "smaller than expected" if rms < low else "as expected",
        ),
    )


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


def _of(values: pd.Series, figure: Callable[[Floats], float]) -> float | None:
    known = values.dropna().to_numpy(np.float64)
    return figure(known) if len(known) else None


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


_KINDS = (
    ("control", "control points", False, ""),
    ("left-out", "control points, each left out", False, LEFT_OUT),
    ("check", "check points", True, ""),
)
_FIGURES: tuple[tuple[str, str, Callable[[Floats], float]], ...] = (
    ("rms", "RMS", _rms),
    ("mean", "mean", lambda values: float(np.mean(values))),
    ("largest", "largest |d|", lambda values: float(np.max(np.abs(values)))),
)
