"""Control and check points: differences computed − given, in metres, in GSD and against their σ."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.report.material import Material
from tasks.report.table import Column, Row, Table, components, numbers, text_column

AXES = ("dx", "dy", "dz")
_HEADINGS = ("east", "north", "up")
MOST_ROWS = 100


def differences(material: Material, is_check: bool) -> pd.DataFrame:
    """The table of control or check points with, for each axis, the difference in GSD and over its σ.

    Columns added: is_check, gsd_m, d{x,y,z}_gsd, d{x,y,z}_ratio (|d|/σ), and ``largest`` of the ratios.
    """
    table = (material.check_points if is_check else material.control_residuals).copy()
    table["is_check"] = is_check
    table["gsd_m"] = material.gsd_at(table["point"]) if len(table) else np.zeros(0)
    for axis in AXES:
        d, sigma = (table[name].to_numpy(np.float64) for name in (f"{axis}_m", f"sigma_{axis}_m"))
        table[f"{axis}_gsd"] = d / table["gsd_m"].to_numpy(np.float64)
        table[f"{axis}_ratio"] = np.divide(np.abs(d), sigma, out=np.full(len(d), np.nan), where=sigma > 0)
    ratios = table[[f"{axis}_ratio" for axis in AXES]]
    table["largest"] = ratios.max(axis=1)
    return table


def point_table(material: Material, is_check: bool) -> Table:
    """One row for each point, the largest |d|/σ first."""
    table = differences(material, is_check).sort_values("largest", ascending=False, kind="stable")
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
    for is_check, kind in ((False, "control"), (True, "check")):
        table = differences(material, is_check)
        if len(table) == 0:
            continue
        for name, words, figure in _FIGURES:
            metres = [_of(table[f"{axis}_m"], figure) for axis in AXES]
            in_gsd = [_of(table[f"{axis}_gsd"], figure) for axis in AXES]
            counted = numbers((float(table[f"{axis}_m"].notna().sum()) for axis in AXES), 0)
            plus = name == "mean"
            cells = (*numbers(metres, 3, plus=plus), *numbers(in_gsd, 2, plus=plus), *counted)
            rows.append(Row(f"{kind}:{name}", (f"{kind} points, {words}", *cells)))
    columns = (
        text_column("figure", "figure"),
        *components("{}_m", _HEADINGS, "m", AXES),
        *components("{}_gsd", _HEADINGS, "GSD", AXES),
        *components("{}_count", [f"n {h}" for h in _HEADINGS], "", AXES),
    )
    return Table("surveyed-statistics", "Differences at control and check points", columns, tuple(rows))


def _of(values: pd.Series, figure: Callable[[Floats], float]) -> float | None:
    known = values.dropna().to_numpy(np.float64)
    return figure(known) if len(known) else None


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


_FIGURES: tuple[tuple[str, str, Callable[[Floats], float]], ...] = (
    ("rms", "RMS", _rms),
    ("mean", "mean", lambda values: float(np.mean(values))),
    ("largest", "largest |d|", lambda values: float(np.max(np.abs(values)))),
)
