"""Control points as check points of themselves: left out one at a time, or a fold at a time.

What an adjustment without some observations K would say about them follows from the one with them. With
whitened residuals v and hat matrix H = A Q Aᵀ

    d_K = (I − H_KK)⁻¹ v_K,    Cov(d_K) = (I − H_KK)⁻¹ = I + A_K Q₍K₎ A_Kᵀ,

d being predicted minus surveyed and Q₍K₎ the cofactors without K, so the covariance contains the survey. It
is exact for linear equations (the deleted residual of regression); the rays of the point stay in the
adjustment.
An observation R that was rejected is predicted as it is, and follows those left out with it:

    d_R = v_R + H_RK d_K,    Cov(d_R) = I + H_RR + H_RK (I − H_KK)⁻¹ H_KR.

Where K is all that holds a point, or the block, I − H_KK is singular and there is no prediction.

Errors of considered parameters move v by B̃ R; the same sums take them to d, and their covariance is added.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.control_point import ControlPoints
from adjust.parameters import OBJECT_POINT
from adjust.quality.joint_cofactor import joint_cofactors

# Squared sine of the angle between an observation and all that is determined without it: below, it is not.
_UNDETERMINED = 1e-6


@dataclass(frozen=True, eq=False)
class ControlCheck:
    """Control points against adjustments that did not know them; rows are those of the group.

    Attributes
    ----------
    fold : (n,) which were left out together.
    difference : (n, 3) predicted minus surveyed along east, north, up, metres; NaN where there is none.
    cofactor : (n, 3, 3) of the differences for σ0 = 1, with that of the survey, m²; NaN likewise.
    considered : (n, 3, 3) what errors of considered parameters and of corrections of image coordinates add to
        their covariance, whatever σ0 is, m².
    """

    fold: Ints
    difference: Floats
    cofactor: Floats
    considered: Floats


@dataclass(frozen=True, eq=False)
class Prediction:
    """Whitened differences (m, 3) of control points, cofactors (m, 3, 3); NaN where undetermined.

    And their errors (m, 3, k) by errors of considered parameters and corrections.
    """

    difference: Floats
    cofactor: Floats
    errors: Floats


@dataclass(frozen=True, eq=False)
class _Whitened:
    """The group of control points in units of its standard deviations.

    Attributes
    ----------
    residual : (n, 3) v; zero for absent components.
    errors : (n, 3, k) of v by k independent errors in the considered parameters and corrections.
    jacobian : (n, 3, 3) with respect to the object point.
    unwhitener : (n, 3, 3) back to metres.
    used : (n,) whether the point was used (and was not rejected).
    known : (n,) whether its object point is an unknown of the adjustment.
    """

    residual: Floats
    errors: Floats
    jacobian: Floats
    unwhitener: Floats
    used: Bools
    known: Bools


def leave_one_out(adjusted: Adjusted, given: ControlPoints, rejected: Bools) -> ControlCheck:
    """Every control point from the adjustment without it.

    Parameters
    ----------
    given : all control points with the weights of the adjustment.
    rejected : (n,) those that were not used.
    """
    whitened = _whitened(adjusted, given, rejected)
    cofactor = np.nan_to_num(adjusted.quality.of_points[given.point])
    hat = whitened.jacobian @ cofactor @ np.swapaxes(whitened.jacobian, 1, 2)
    one_each = np.arange(len(given.point), dtype=np.int64)
    return _check(given, whitened, one_each, ((np.array([row]), hat[row]) for row in one_each))


def k_fold(adjusted: Adjusted, given: ControlPoints, rejected: Bools, folds: int) -> ControlCheck:
    """Every control point from the adjustment without its fold.

    Parameters
    ----------
    given, rejected : as of :func:`leave_one_out`.
    folds : number of folds, at least 2; each covers the whole area.
    """
    whitened = _whitened(adjusted, given, rejected)
    fold = spread_folds(adjusted.state.object_point[given.point, :2], folds)
    points, place = np.unique(given.point[whitened.known], return_inverse=True)
    row_of = np.full(len(given.point), -1, dtype=np.int64)
    row_of[whitened.known] = place
    cofactor = joint_cofactors(adjusted.system, adjusted.solution, points)

    def hats() -> Iterator[tuple[Ints, Floats]]:
        for number in np.unique(fold):
            rows = np.flatnonzero((fold == number) & whitened.known)
            own, jacobian = row_of[rows], whitened.jacobian[rows]
            joint = cofactor[np.ix_(own, np.arange(3), own, np.arange(3))]
            hat = np.einsum("aij,ajbk,blk->aibl", jacobian, joint, jacobian, optimize=True)
            yield rows, hat.reshape(3 * len(rows), 3 * len(rows))

    return _check(given, whitened, fold, hats())


def spread_folds(xy: Floats, folds: int) -> Ints:
    """Fold (n,) of points (n, 2): neighbours along a Z-shaped curve through the area are dealt in turn."""
    if len(xy) == 0:
        return np.zeros(0, dtype=np.int64)
    low, size = xy.min(axis=0), max(float(np.ptp(xy, axis=0).max()), 1e-9)
    cell = np.floor((xy - low) / size * 1023.0).astype(np.int64)
    key = np.zeros(len(xy), dtype=np.int64)
    for bit in range(10):
        key |= ((cell[:, 0] >> bit) & 1) << (2 * bit)
        key |= ((cell[:, 1] >> bit) & 1) << (2 * bit + 1)
    fold = np.empty(len(xy), dtype=np.int64)
    fold[np.argsort(key, kind="stable")] = np.arange(len(xy)) % min(folds, len(xy))
    return fold


def predicted_without(residual: Floats, hat: Floats, used: Bools, errors: Floats | None = None) -> Prediction:
    """Whitened predictions of m points that are left out together.

    Parameters
    ----------
    residual : (m, 3) whitened residuals.
    hat : (3 m, 3 m) hat matrix A Q Aᵀ of their whitened observations.
    used : (m,) those that were used in the adjustment.
    errors : (m, 3, k) of the residuals by errors of considered parameters and corrections; None without any.
    """
    m = len(used)
    moved = np.zeros((3 * m, 0)) if errors is None else errors.reshape(3 * m, errors.shape[2]).copy()
    rows = np.repeat(used, 3)
    values, vectors = np.linalg.eigh(np.eye(int(rows.sum())) - hat[np.ix_(rows, rows)])
    lost = values < _UNDETERMINED
    inverse = (vectors[:, ~lost] / values[~lost]) @ vectors[:, ~lost].T
    difference, cofactor = residual.ravel().copy(), np.eye(3 * m) + hat
    difference[rows], moved[rows] = inverse @ residual[used].ravel(), inverse @ moved[rows]
    cofactor[np.ix_(rows, rows)] = inverse
    mixed = hat[np.ix_(~rows, rows)]
    difference[~rows] += mixed @ difference[rows]
    moved[~rows] += mixed @ moved[rows]
    cofactor[np.ix_(~rows, ~rows)] += mixed @ inverse @ mixed.T
    share = np.zeros(3 * m)
    share[rows] = np.sum(vectors[:, lost] ** 2, axis=1)
    share[~rows] = np.sum((mixed @ vectors[:, lost]) ** 2, axis=1)
    undetermined = np.asarray((share > _UNDETERMINED).reshape(m, 3).any(axis=1))
    of_points = cofactor.reshape(m, 3, m, 3)[np.arange(m), :, np.arange(m), :]
    return Prediction(
        np.where(undetermined[:, None], np.nan, difference.reshape(m, 3)),
        np.where(undetermined[:, None, None], np.nan, of_points),
        moved.reshape(m, 3, moved.shape[1]),
    )


def _whitened(adjusted: Adjusted, given: ControlPoints, rejected: Bools) -> _Whitened:
    equations = given.linearize(adjusted.state)
    jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    model = given.stochastic
    known: Bools = adjusted.system.active_point[given.point] & np.asarray(model.present.any(axis=1))
    residual = np.where(model.present, -equations.misclosure, 0.0)
    return _Whitened(
        np.einsum("nij,nj->ni", model.whitener, residual),
        _errors(adjusted, given.point, model.whitener @ jacobian),
        model.whitener @ jacobian,
        model.unwhitener,
        known & ~rejected,
        known,
    )


def _errors(adjusted: Adjusted, point: Ints, jacobian: Floats) -> Floats:
    """Errors (n, 3, k) of whitened residuals by those of considered parameters and corrections."""
    errors = adjusted.quality.errors_of_unknowns
    if errors is None:
        return np.zeros((*jacobian.shape[:2], 0))
    return np.asarray(jacobian @ errors.of_points[point])


def _check(
    given: ControlPoints, whitened: _Whitened, fold: Ints, hats: Iterator[tuple[Ints, Floats]]
) -> ControlCheck:
    """Predictions of all folds, in metres."""
    present = given.stochastic.present
    difference = np.full(present.shape, np.nan)
    cofactor = np.full((*present.shape, 3), np.nan)
    considered = np.zeros((*present.shape, 3))
    for rows, hat in hats:
        found = predicted_without(whitened.residual[rows], hat, whitened.used[rows], whitened.errors[rows])
        back = whitened.unwhitener[rows]
        difference[rows] = np.einsum("nij,nj->ni", back, found.difference)
        cofactor[rows] = back @ found.cofactor @ np.swapaxes(back, 1, 2)
        errors = back @ found.errors
        considered[rows] = errors @ np.swapaxes(errors, 1, 2)
    exists = present & whitened.known[:, None]
    both = exists[:, :, None] & exists[:, None, :]
    return ControlCheck(
        fold, np.where(exists, difference, np.nan), np.where(both, cofactor, np.nan), considered
    )
