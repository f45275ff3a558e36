"""Whether two groups of strips differ in boresight or lever arm by more than the scatter of the strips.

Strips that follow each other share slow errors of GNSS and INS. Their residuals show it as a correlation ρ
from one strip to the next; the variance of a mean is then larger by (1 + ρ) / (1 − ρ) than that of
independent strips (first-order autoregression).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.orientation_differences import MISALIGNMENT, SHIFT
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import (
    LinearFit,
    body_fixed,
    estimable,
    linear_fit,
    map_fixed,
    membership,
)

# More serial correlation leaves hardly any independent strip.
_MOST_CORRELATED = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class StripComparison:
    """Boresights and lever arms of groups of strips, adjusted together with a GNSS shift of each flight.

    Attributes
    ----------
    names : (g,) numbers of the groups, ascending.
    misalignment : fits of roll, pitch, yaw; one unknown for each group.
    plan : fit of the offsets; its last 2 g unknowns are forward and right of each group.
    plan_design : its design.
    variance : (4,) of a strip, increased for serial correlation: roll, pitch, yaw, plan.
    """

    names: Ints
    misalignment: tuple[LinearFit, ...]
    plan: LinearFit
    plan_design: Floats
    variance: Floats

    @classmethod
    def of(cls, strips: StripMeans, group: Ints, kept: Bools | None = None) -> Self:
        """The comparison for the selected strips."""
        rows = np.arange(len(group)) if kept is None else np.flatnonzero(kept)
        order = rows[np.lexsort((strips.place[rows], strips.flight[rows]))]
        own, flight = group[order], strips.flight[order]
        members, angles = membership(own), strips.mean[order, MISALIGNMENT]
        fits = tuple(linear_fit(members, column) for column in angles.T)
        design = np.hstack([map_fixed(flight), body_fixed(strips.heading[order], own)])
        offset = strips.mean[order, SHIFT][:, :2].ravel()
        plan = linear_fit(design, offset)
        residuals = [
            (column - members @ fit.solution)[:, None] for column, fit in zip(angles.T, fits, strict=True)
        ]
        residuals.append((offset - design @ plan.solution).reshape(-1, 2))
        increase = np.array([serial_increase(residual, flight) for residual in residuals])
        variance = np.array([fit.variance for fit in (*fits, plan)])
        return cls(np.unique(own), fits, plan, design, variance * increase)

    def differences(self, one: int, other: int) -> tuple[Floats, Floats]:
        """Roll, pitch, yaw, forward, right (5,) of a group less those of another; covariance (5, 5).

        NaN where the strips do not say it.
        """
        place = {int(name): number for number, name in enumerate(self.names)}
        contrast = np.zeros(len(self.names))
        contrast[place[one]], contrast[place[other]] = 1.0, -1.0
        difference, covariance = np.full(5, np.nan), np.full((5, 5), np.nan)
        for number, fit in enumerate(self.misalignment):
            difference[number] = contrast @ fit.solution
            covariance[number, number] = contrast @ fit.cofactor @ contrast * self.variance[number]
        unknowns = len(self.plan.solution)
        in_plan = np.hstack([np.zeros((2, unknowns - 2 * len(contrast))), np.kron(contrast, np.eye(2))])
        if estimable(self.plan_design, in_plan).all():
            difference[3:] = in_plan @ self.plan.solution
            covariance[3:, 3:] = in_plan @ self.plan.cofactor @ in_plan.T * self.variance[3]
        return difference, covariance

    def probabilities(self, one: int, other: int) -> Floats:
        """Of differences as large by chance (4,): roll, pitch, yaw, plan; NaN where the strips do not say."""
        return chances(*self.differences(one, other), self._freedom)

    def differing(self, one: int, other: int, limits: Floats) -> float:
        """The smallest probability of a component that differs by more than its limit (4,); 1: none does."""
        return least_chance(*self.differences(one, other), self._freedom, limits)

    @property
    def _freedom(self) -> Floats:
        return np.array([float(fit.freedom) for fit in (*self.misalignment, self.plan)])


def chances(difference: Floats, covariance: Floats, freedom: Floats) -> Floats:
    """Probabilities (4,) of differences (5,) as large by chance: roll, pitch, yaw, plan; NaN where unknown.

    Parameters
    ----------
    covariance, freedom : (5, 5), and the degrees of freedom (4,) of its variances.
    """
    found = np.full(4, np.nan)
    for number in range(3):
        squares = _over(difference[number] ** 2, covariance[number, number])
        found[number] = _probability(squares, 1, freedom[number])
    if np.isfinite(difference[3:]).all():
        in_plan, spread = difference[3:], covariance[3:, 3:]
        exact = not np.trace(spread) > 0.0
        weighted = in_plan if exact else np.linalg.solve(spread, in_plan)
        squares = _over(float(in_plan @ weighted), 0.0 if exact else 1.0)
        found[3] = _probability(squares, 2, freedom[3])
    return found


def least_chance(difference: Floats, covariance: Floats, freedom: Floats, limits: Floats) -> float:
    """The smallest of `chances` of a component that differs by more than its limit (4,); 1: none does."""
    sizes = np.append(np.abs(difference[:3]), np.linalg.norm(difference[3:]))
    found = chances(difference, covariance, freedom)
    return float(np.min(found[(sizes > limits) & np.isfinite(found)], initial=1.0))


def serial_increase(residual: Floats, flight: Ints) -> float:
    """(1 + ρ) / (1 − ρ) of residuals (k, c) in the order of flight; at least 1."""
    squares = float(np.sum(residual**2))
    next_to = flight[1:] == flight[:-1]
    if squares == 0.0 or not next_to.any():
        return 1.0
    products = float(np.sum((residual[1:] * residual[:-1])[next_to])) / float(next_to.sum())
    correlation = min(max(products / (squares / len(residual)), 0.0), _MOST_CORRELATED)
    return (1.0 + correlation) / (1.0 - correlation)


def _over(squares: float, variance: float) -> float:
    """Squares over a variance that may be zero."""
    return float(squares / variance) if variance > 0.0 else (np.inf if squares > 1e-24 else 0.0)


def _probability(squares: float, number: int, freedom: float) -> float:
    return float(special.fdtrc(number, freedom, squares / number)) if freedom > 0 else float("nan")
