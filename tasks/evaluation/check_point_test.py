"""Whether the differences at check points are as large as expected from their standard deviations.

Σ = σ0² Q + Σ_survey for each coordinate, Q with the correlations of the adjusted points: they have common
images and parameters, so many points may hold little more than one draw. σ0² is of what was adjusted;
the survey of the check points was not, and stands as stated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.georeferencing.predicted_rms import rms_of_covariance
from adjust.quality.control_checks import spread_folds
from tasks.block.block_input import SurveyedPoints
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.evaluation.surveyed_differences import surveyed_differences
from tasks.results.summary import CheckPointTest
from tasks.tables.places import places_of

#: Check points of a larger number are tested at so many, spread over the area: their joint cofactors take
#: three solutions each.
MOST_TESTED = 300
_AXES = ("dx_m", "dy_m", "dz_m")


def tested_points(block: Block, surveyed: SurveyedPoints) -> tuple[int, ...]:
    """Object points of the block, ascending, at which its check points are tested."""
    index = places_of(surveyed.name, block.points)
    points = np.sort(index[(index >= 0) & surveyed.is_check])
    parts = -(-len(points) // MOST_TESTED)
    if parts > 1:
        points = points[spread_folds(block.object_point[points, :2], parts) == 0]
    return tuple(int(point) for point in points)


def check_point_test(adjusted: AdjustedBlock, confidence: float) -> CheckPointTest | None:
    """Found and predicted figures along east, north, up; None without check points, or without a datum.

    The limits of root mean square and mean apply to all figures together with the probability `confidence`
    (each for its part, Bonferroni). ``over_limit`` is the largest of all found figures over its upper
    limit: above 1 the check points are beyond their limits.
    """
    joint = adjusted.result.joint_cofactor
    if joint is None:
        return None
    table = surveyed_differences(adjusted, is_check=True)
    names = pd.Index([adjusted.block.points[point] for point in joint.points])
    row = pd.Index(table["point"]).get_indexer(names)
    difference = table[list(_AXES)].to_numpy(np.float64)[row]
    known = np.isfinite(difference)
    figures = int(2 * known.any(axis=0).sum())
    if figures == 0:
        return None
    covariance = _covariance(adjusted, joint.points, joint.matrix)
    each = 1.0 - (1.0 - confidence) / figures
    axes = [
        _axis_figures(difference[known[:, k], k], covariance[k][np.ix_(known[:, k], known[:, k])], each)
        for k in range(3)
    ]
    found = {name: tuple(axis[name] for axis in axes) for name in axes[0]}
    return CheckPointTest.model_validate({**found, "confidence": confidence, "over_limit": _over_limit(axes)})


def _covariance(adjusted: AdjustedBlock, points: Ints, cofactor: Floats) -> Floats:
    """Covariances (3, k, k) of the differences along east, north, up, with the survey; m².

    Errors of considered parameters and of corrections of the image coordinates are common to all points.
    """
    surveyed = adjusted.surveyed
    axes = np.array(adjusted.frame.local_from_enu(adjusted.result.state.object_point[points]))
    of_points = adjusted.sigma0**2 * np.einsum("aic,aibj,bjc->cab", axes, cofactor, axes, optimize=True)
    if (errors := adjusted.result.cofactor.errors_of_unknowns) is not None:
        along = np.einsum("aic,aik->cak", axes, errors.of_points[points])
        of_points += along @ np.swapaxes(along, 1, 2)
    name = pd.Index(surveyed.name).get_indexer(pd.Index([adjusted.block.points[point] for point in points]))
    survey = np.diagonal(surveyed.covariance[name], axis1=1, axis2=2)
    return np.asarray(of_points + np.einsum("ac,ab->cab", survey, np.eye(len(points))))


def _axis_figures(difference: Floats, covariance: Floats, confidence: float) -> dict[str, float | None]:
    """Figures of one coordinate; null without any point that has it."""
    names = ("rmse_m", "predicted_rmse_m", "predicted_low_m", "predicted_high_m", "ratio", "mean_m")
    figures: dict[str, float | None] = dict.fromkeys((*names, "predicted_mean_sigma_m", "mean_limit_m"))
    figures |= {"degrees_of_freedom": None, "points": len(difference)}
    if len(difference) == 0:
        return figures
    predicted = rms_of_covariance(covariance)
    rms, (low, high) = float(np.sqrt(np.mean(difference**2))), predicted.limits(confidence)
    values = (rms, predicted.rms, low, high, rms / predicted.rms, float(difference.mean()))
    return figures | {
        **dict(zip(names, values, strict=True)),
        "predicted_mean_sigma_m": predicted.sigma_of_mean,
        "mean_limit_m": float(special.ndtri(0.5 + 0.5 * confidence)) * predicted.sigma_of_mean,
        "degrees_of_freedom": predicted.degrees_of_freedom,
    }


def _over_limit(axes: Sequence[Mapping[str, float | None]]) -> float:
    """Largest found figure over its upper limit."""
    pairs = [
        (axis[found], axis[limit])
        for axis in axes
        for found, limit in (("rmse_m", "predicted_high_m"), ("mean_m", "mean_limit_m"))
    ]
    return max(abs(found) / limit for found, limit in pairs if found is not None and limit is not None)
