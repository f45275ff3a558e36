"""What strips show beyond errors of the adjusted block, which the strips have in common.

All strips together show roll, pitch, yaw, east and north, y = X β + a + e. β are a misalignment and a lever
arm of each mounting and a GNSS shift of each flight. Errors a of the adjusted orientations have the known
joint covariance Q: on few control points the whole block is tilted or bent, which looks like another
boresight in every direction of flight. Errors e of GNSS and INS have one variance for each of roll, pitch,
yaw and plan, S, by which their squares become what is expected (restricted maximum likelihood, Patterson and
Thompson 1971). Then β by least squares with Q + S, and â = Q (Q + S)⁻¹ (y − X β) is what errors of the block
explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.orientation_differences import LEVER_ARM, MISALIGNMENT, SHIFT
from adjust.calibration.strip_comparison import least_chance
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import (
    LinearFit,
    body_fixed,
    estimable,
    linear_fit,
    map_fixed,
    membership,
)

_ROUNDS = 50
# Errors of strips are not below this part of the stated ones: Q is no better known.
_LEAST_SIGMA = 0.05
# Of roll, pitch, yaw, east, north: which variance.
_VARIANCE = np.array([0, 1, 2, 3, 3])


@dataclass(frozen=True, slots=True, eq=False)
class JointStrips:
    """Misalignments and offsets of all strips together.

    Attributes
    ----------
    mountings : (m,) their numbers, ascending.
    fit : of all values in units of their joint σ; misalignment and lever arm of every mounting come last.
    design : (5 k, u) in the same units.
    explained : (k, 5) roll, pitch, yaw, east, north that errors of the block explain.
    freedom : (4,) degrees of freedom of the variances of roll, pitch, yaw and plan.
    """

    mountings: Ints
    fit: LinearFit
    design: Floats
    explained: Floats
    freedom: Floats

    @classmethod
    def of(cls, strips: StripMeans, mounting: Ints, errors: StripErrors, strip_sigma: Floats) -> Self:
        """Fit strips (k,) with these mountings.

        Parameters
        ----------
        errors : of the adjusted orientations of the strips.
        strip_sigma : (4,) stated errors of INS and GNSS of a strip: roll, pitch, yaw, plan.
        """
        k = len(mounting)
        y = np.hstack([strips.mean[:, MISALIGNMENT], strips.mean[:, SHIFT][:, :2]]).ravel()
        known = errors.covariance[:, :5, :, :5].reshape(5 * k, 5 * k)
        design, which = _design(strips, mounting), np.tile(_VARIANCE, k)
        variance = strip_sigma**2
        for _ in range(_ROUNDS):
            noise = variance[which]
            factor = np.linalg.cholesky(known + np.diag(noise))
            whitened = np.linalg.solve(factor, design)
            fit = linear_fit(whitened, np.linalg.solve(factor, y))
            # P y and the diagonal of P = (Q + S)⁻¹ less what the unknowns take of it.
            inverse = np.linalg.inv(factor)
            left = inverse.T @ (inverse @ (y - design @ fit.solution))
            of_unknowns = inverse.T @ whitened
            diagonal = np.sum(inverse**2, axis=0) - np.sum((of_unknowns @ fit.cofactor) * of_unknowns, axis=1)
            squares = np.bincount(which, (noise * left) ** 2, 4)
            expected = np.maximum(np.bincount(which, noise**2 * diagonal, 4), 1e-12 * variance)
            before, variance = variance, variance * squares / expected
            variance = np.maximum(variance, (_LEAST_SIGMA * strip_sigma) ** 2)
            if np.all(np.abs(variance / before - 1.0) < 1e-3):
                break
        freedom = np.maximum(np.bincount(which, noise * diagonal, 4), 1.0)
        return cls(np.unique(mounting), fit, whitened, (known @ left).reshape(k, 5), freedom)

    def less_explained(self, strips: StripMeans) -> StripMeans:
        """The strips without what errors of the block explain; heights as they are."""
        mean = strips.mean.copy()
        turn = body_fixed(strips.heading, np.arange(len(strips.strip)))
        in_map = self.explained[:, 3:]
        mean[:, MISALIGNMENT] -= self.explained[:, :3]
        mean[:, SHIFT.start : SHIFT.start + 2] -= in_map
        mean[:, LEVER_ARM.start : LEVER_ARM.start + 2] -= (turn.T @ in_map.ravel()).reshape(-1, 2)
        return replace(strips, mean=mean)

    def differences(self, one: int, other: int) -> tuple[Floats, Floats]:
        """Roll, pitch, yaw, forward, right (5,) of a mounting less those of another; covariance (5, 5).

        NaN where the strips do not say it.
        """
        m, unknowns = len(self.mountings), len(self.fit.solution)
        contrast = (self.mountings == one).astype(np.float64) - (self.mountings == other)
        rows = np.zeros((5, unknowns))
        rows[:3, unknowns - 5 * m : unknowns - 2 * m] = np.kron(contrast, np.eye(3))
        rows[3:, unknowns - 2 * m :] = np.kron(contrast, np.eye(2))
        said = estimable(self.design, rows)
        said[3:] = said[3:].all()
        difference = np.where(said, rows @ self.fit.solution, np.nan)
        covariance = rows @ self.fit.cofactor @ rows.T
        return difference, np.where(said[:, None] & said, covariance, np.nan)

    def differing(self, one: int, other: int, limits: Floats) -> float:
        """The smallest probability of a component that differs by more than its limit (4,); 1: none does."""
        return least_chance(*self.differences(one, other), self.freedom, limits)


def _design(strips: StripMeans, mounting: Ints) -> Floats:
    """(5 k, 2 f + 5 m) of shifts of the flights, misalignments and lever arms of the mountings."""
    k = len(mounting)
    shifts, arms = map_fixed(strips.flight), body_fixed(strips.heading, mounting)
    angles = np.kron(membership(mounting), np.eye(3))
    f, m = shifts.shape[1], arms.shape[1] // 2
    design = np.zeros((k, 5, f + 5 * m))
    design[:, 3:, :f] = shifts.reshape(k, 2, f)
    design[:, :3, f : f + 3 * m] = angles.reshape(k, 3, 3 * m)
    design[:, 3:, f + 3 * m :] = arms.reshape(k, 2, 2 * m)
    return design.reshape(5 * k, -1)
