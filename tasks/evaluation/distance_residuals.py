"""Distances between object points after the adjustment: adjusted values, and differences against σ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import special

from adjust.observations.distance import Distances
from adjust.quality.single_error import hat_matrices
from adjust.result import GroupResult, ObservationStatus
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.results.summary import DistanceFigures
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.adjustment import DISTANCE_RESIDUALS


def write_distance_residuals(folder: Path, adjusted: AdjustedBlock) -> pd.DataFrame:
    """distance_residuals.parquet: computed − given, with the predicted standard deviation.

    That of a distance that were used is σ0 √(σ² − q), that of one that did not √(σ² + σ0² q), with the
    cofactor q of the adjusted distance, as for control and check points.
    """
    parts = [_rows(adjusted, item) for item in adjusted.result.groups if isinstance(item.group, Distances)]
    names = [column.name for column in DISTANCE_RESIDUALS.columns]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=names)
    write_stage_table(folder, DISTANCE_RESIDUALS, table[names])
    return table


def _rows(adjusted: AdjustedBlock, item: GroupResult) -> pd.DataFrame:
    group, result, factor = item.group, adjusted.result, adjusted.sigma0**2
    assert isinstance(group, Distances)
    equations = group.linearize(result.state)
    held = factor * hat_matrices(equations, equations, result.layout, result.cofactor)[:, 0, 0]
    considered = result.cofactor.considered
    added = 0.0 if considered is None else considered.covariance_of_residuals(equations)[:, 0, 0]
    own = item.sigma[:, 0] ** 2
    status = item.status[:, 0]
    out = np.isin(status, (ObservationStatus.REJECTED, ObservationStatus.NOT_USED))
    # Errors of considered parameters add to the variance of a residual, too.
    variance = np.where(out, own + held, np.maximum(factor * own - held, 0.0)) + added
    names = np.array(adjusted.block.points, dtype=object)
    kept = result.active_point[group.point] & result.active_point[group.other_point]
    table = pd.DataFrame(
        {
            "point": names[group.point],
            "other_point": names[group.other_point],
            "distance_m": group.given,
            "difference_m": item.residual[:, 0],
            "sigma_difference_m": np.sqrt(variance),
            "status": np.select(
                [status == ObservationStatus.REJECTED, status == ObservationStatus.NOT_USED],
                ["rejected", "check"],
                "used",
            ),
        }
    )
    return table[kept]


def distance_figures(table: pd.DataFrame, confidence: float) -> DistanceFigures | None:
    """For summary.json; None without distances.

    ``over_limit`` is the largest |difference| of a check distance over its limit; all limits together hold
    with the probability `confidence` (each for its part, Bonferroni). Null without check distances.
    """
    if len(table) == 0:
        return None
    used, check = (table[table["status"] == status] for status in ("used", "check"))
    beyond = over_limit(check, confidence)
    return DistanceFigures(
        used=len(used),
        rejected=int((table["status"] == "rejected").sum()),
        check=len(check),
        rms_used_m=_rms(used),
        rms_check_m=_rms(check),
        max_check_m=float(check["difference_m"].abs().max()) if len(check) else None,
        confidence=confidence,
        over_limit=float(beyond.max()) if len(beyond) else None,
    )


def over_limit(check: pd.DataFrame, confidence: float) -> pd.Series:
    """|difference| over its limit, of each check distance."""
    each = (1.0 - confidence) / max(len(check), 1)
    limit = float(special.ndtri(1.0 - 0.5 * each)) * check["sigma_difference_m"]
    return check["difference_m"].abs() / limit


def _rms(table: pd.DataFrame) -> float | None:
    return float(np.sqrt(np.mean(table["difference_m"] ** 2))) if len(table) else None
