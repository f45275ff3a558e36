"""Control and check points after the adjustment: adjusted, and as predicted without each of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.control_point import ControlPoints
from adjust.quality.control_checks import ControlCheck
from adjust.result import AdjustmentResult, ObservationStatus
from tasks.evaluation.result_tables import AdjustedBlock, variances, xyz_columns
from tasks.files.json_text import JSON
from tasks.results.figures import LeftOutFigure
from tasks.tables.parquet import write_stage_table
from tasks.tables.places import places_of
from tasks.tables.schemas.adjustment import CHECK_POINTS, CONTROL_RESIDUALS


def write_control_residuals(folder: Path, adjusted: AdjustedBlock) -> None:
    """control_residuals.parquet and check_points.parquet: computed − given along east, north, up.

    The predicted standard deviation of a control residual is that of v, σ0 √(σ² − q). That of a point that
    were not used, as a check point, because it was rejected or as it would be left out, is √(σ² + σ0² q): σ0
    is of what was adjusted, so a survey that was not stands as stated, here and everywhere.
    """
    for is_check, schema in ((False, CONTROL_RESIDUALS), (True, CHECK_POINTS)):
        table = surveyed_differences(adjusted, is_check)
        if not is_check:
            table = _with_left_out(adjusted, table)
        write_stage_table(folder, schema, table)


def surveyed_differences(adjusted: AdjustedBlock, is_check: bool) -> pd.DataFrame:
    """Columns of control_residuals, with ``status``, or check_points for the points that were measured."""
    surveyed, result = adjusted.surveyed, adjusted.result
    index = adjusted.surveyed_point
    chosen = np.flatnonzero((index >= 0) & (surveyed.is_check == is_check))
    chosen = chosen[result.active_point[index[chosen]]]
    points = index[chosen]
    computed = result.state.object_point[points]
    given = surveyed.x_in_local[chosen]
    anchor = np.where(np.isfinite(given), given, computed)
    axes = np.array(adjusted.frame.local_from_enu(anchor))
    difference = np.einsum("nji,nj->ni", axes, computed - anchor)
    if len(chosen):
        difference[:, 2] = adjusted.frame.height(computed) - surveyed.height[chosen]
    difference = np.where(surveyed.present[chosen], difference, np.nan)
    turned = np.swapaxes(axes, 1, 2)
    held, spread = (
        variances(turned, quality.of_points[points]) * adjusted.sigma0**2
        for quality in (result.cofactor, adjusted.cofactor)
    )
    given_variance = np.diagonal(surveyed.covariance[chosen], axis1=1, axis2=2)
    left_out = np.full(len(points), is_check) | np.isin(points, _rejected(adjusted))
    # Errors of considered parameters add to the variance of a residual, too.
    of_residual = np.maximum(given_variance * adjusted.sigma0**2 - held, 0.0) + (spread - held)
    variance = np.where(left_out[:, None], given_variance + spread, of_residual)
    sigma = np.where(surveyed.present[chosen], np.sqrt(variance), np.nan)
    status = {} if is_check else {"status": np.where(left_out, "rejected", "used")}
    return pd.DataFrame(
        {
            "point": np.array(surveyed.name, dtype=object)[chosen],
            **xyz_columns("{}_m", ("dx", "dy", "dz"), difference),
            **xyz_columns("sigma_{}_m", ("dx", "dy", "dz"), sigma),
            "rays": adjusted.rays_used[points],
            **status,
        }
    )


def rejected_control(adjusted: AdjustedBlock) -> tuple[str, ...]:
    """Names of the control points that were rejected as gross errors, ascending."""
    return tuple(sorted(adjusted.block.points[point] for point in _rejected(adjusted)))


def uncontrolled_control(adjusted: AdjustedBlock) -> tuple[str, ...]:
    """Coordinates of control points that nothing controls: ``z of C012``; in the order of the points."""
    return tuple(
        f"{group.group.components[axis]} of {adjusted.block.points[group.group.point[row]]}"
        for group in adjusted.result.groups
        if isinstance(group.group, ControlPoints)
        for row, axis in np.argwhere(group.status == ObservationStatus.UNCONTROLLED)
    )


def _rejected(adjusted: AdjustedBlock) -> Ints:
    """Object points whose survey was rejected."""
    found = [
        group.group.point[(group.status == ObservationStatus.REJECTED).any(axis=1)]
        for group in adjusted.result.groups
        if isinstance(group.group, ControlPoints)
    ]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def _with_left_out(adjusted: AdjustedBlock, table: pd.DataFrame) -> pd.DataFrame:
    """With loo_dx_m … and sigma_loo_dx_m …: each control point against the adjustment without it.

    NaN for what is not known or what nothing else determines.
    """
    result = adjusted.result
    difference, sigma = np.full((len(table), 3), np.nan), np.full((len(table), 3), np.nan)
    control = _control(result)
    if control is not None and result.left_out_singly is not None:
        row = places_of(table["point"], [adjusted.block.points[point] for point in control.point])
        difference[row >= 0] = result.left_out_singly.difference[row[row >= 0]]
        sigma[row >= 0] = _sigma(result.left_out_singly, control, adjusted.sigma0)[row[row >= 0]]
    left_out = {
        **xyz_columns("loo_{}_m", ("dx", "dy", "dz"), difference),
        **xyz_columns("sigma_loo_{}_m", ("dx", "dy", "dz"), sigma),
    }
    return table.assign(**left_out)


def left_out_figures(check: ControlCheck | None, result: AdjustmentResult, sigma0: float) -> JSON:
    """Root mean square and largest differences, in metres and over their σ; null where nothing is known."""
    control = _control(result)
    if check is None or control is None or not np.isfinite(check.difference).any():
        return None
    known = np.isfinite(check.difference)
    ratio = check.difference / _sigma(check, control, sigma0)
    return LeftOutFigure(
        folds=len(np.unique(check.fold)),
        points=int(known.any(axis=1).sum()),
        rmse_m=_each_axis(check.difference, known, "rms"),
        max_m=_each_axis(check.difference, known, "largest"),
        rms_over_sigma=_each_axis(ratio, known, "rms"),
    ).to_json()


def _sigma(check: ControlCheck, control: ControlPoints, sigma0: float) -> Floats:
    """Predicted standard deviations (n, 3), metres; the survey is in the cofactors and stays as stated."""
    survey = control.stochastic.sigma**2
    own, considered = (np.diagonal(item, axis1=1, axis2=2) for item in (check.cofactor, check.considered))
    return np.asarray(np.sqrt(survey + sigma0**2 * (own - survey) + considered))


def _control(result: AdjustmentResult) -> ControlPoints | None:
    """The control points as they were weighted."""
    return next((item.group for item in result.groups if isinstance(item.group, ControlPoints)), None)


def _each_axis(values: Floats, known: Bools, figure: str) -> tuple[float | None, ...]:
    """A figure of the known values of each axis; null without any."""
    found: list[float | None] = []
    for axis in range(3):
        own = np.abs(values[known[:, axis], axis])
        if len(own) == 0:
            found.append(None)
        else:
            found.append(float(own.max() if figure == "largest" else np.sqrt(np.mean(own**2))))
    return tuple(found)
