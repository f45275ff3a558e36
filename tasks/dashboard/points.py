"""Check points as a table: the biggest differences first, each with a traffic light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from tasks.dashboard.lights import GRAVITY, Light, lit
from tasks.dashboard.markdown import in_a_cell
from tasks.dashboard.run import EndedRun
from tasks.georeferencing.point_differences import INDEPENDENT
from tasks.quality_gates import GateResult
from tasks.report.table import numbers
from tasks.storage.artifact import Artifact
from tasks.tables.parquet import read_table

#: Rows of the table, so that the artifact stays small.
MOST_ROWS = 100
#: A difference of more than so many σ is remarkable.
MOST_SIGMA = 3.0
_AXES = ("x", "y", "z")
_HEADINGS = ("east", "north", "up")
#: By the name of a table in the manifest: the gate of a single difference.
_TABLES = {"direct_georeferencing": "direct_georeferencing_max_m", "check_points": "max_check_m"}


def point_table(run: EndedRun) -> tuple[str, Sequence[Mapping[str, str]]] | None:
    """What is shown, a sentence, and the rows; None if the run has no check points."""
    name = next((name for name in _TABLES if name in run.published), None)
    if name is None or run.summary is None:
        return None
    judged = _judged(run.published[name], _limits(run.summary.gates, _TABLES[name]))
    if judged.empty:
        return None
    shown = judged.head(MOST_ROWS)
    kind = "independent check points" if name == "direct_georeferencing" else "check points"
    file = run.published[name].path.name
    words = f"{len(judged)} {kind}, the gravest first; computed − given."
    if len(shown) < len(judged):
        words = f"The {len(shown)} gravest of {len(judged):,} {kind}, computed − given; all are in {file}."
    return words, [_row(row) for row in shown.to_dict("records")]


def _limits(gates: Sequence[GateResult], gate: str) -> dict[str, float]:
    """Largest size of each component that passes; only those with a limit."""
    return {one.name.removeprefix(f"{gate}_"): one.limit for one in gates if one.name.startswith(f"{gate}_")}


def _judged(table: Artifact, limits: Mapping[str, float]) -> pd.DataFrame:
    """The points with their light and words, the gravest and biggest first."""
    points = read_table(table)
    if "status" in points:
        points = points[points["status"] == INDEPENDENT]
    size = points[[f"d{axis}_m" for axis in _AXES]].abs().to_numpy(np.float64)
    sigma = points[[f"sigma_d{axis}_m" for axis in _AXES]].to_numpy(np.float64)
    ratio = np.divide(size, sigma, out=np.full(size.shape, np.nan), where=sigma > 0)
    most = np.array([limits.get(axis, np.inf) for axis in _AXES])
    judged = [_light(*one, limits=most) for one in zip(size, ratio, strict=True)]
    lights = [light for light, _ in judged]
    return (
        points.assign(
            words=[lit(*one) for one in judged],
            gravity=[GRAVITY.index(light) for light in lights],
            largest=np.nan_to_num(ratio, nan=-1.0).max(axis=1, initial=-1.0),
        )
        .sort_values(["gravity", "largest"], ascending=[True, False], kind="stable")
        .reset_index(drop=True)
    )


def _light(size: np.ndarray, ratio: np.ndarray, limits: np.ndarray) -> tuple[Light, str]:
    """The light of one point and why."""
    beyond = [name for name, over in zip(_HEADINGS, size > limits, strict=True) if over]
    if beyond:
        return "bad", f"beyond the limit in {', '.join(beyond)}"
    wide = [name for name, over in zip(_HEADINGS, ratio > MOST_SIGMA, strict=True) if over]
    if wide:
        return "attention", f"more than {MOST_SIGMA:g} σ in {', '.join(wide)}"
    if not np.isfinite(size).any():
        return "attention", "no difference is known"
    return "good", f"within {MOST_SIGMA:g} σ" + (" and the limit" if np.isfinite(limits).any() else "")


def _row(row: Mapping[object, object]) -> dict[str, str]:
    d = numbers((float(str(row[f"d{axis}_m"])) for axis in _AXES), 3, plus=True)
    sigma = numbers((float(str(row[f"sigma_d{axis}_m"])) for axis in _AXES), 3)
    return {
        "point": in_a_cell(str(row["point"])),
        "verdict": str(row["words"]),
        **{
            f"{name} [m]": f"{size} (σ {expected})"
            for name, size, expected in zip(_HEADINGS, d, sigma, strict=True)
        },
        "rays": str(row["rays"]),
    }
