"""Errors of adjusted orientations that are common to a strip, or to several strips.

The mean over the images of strip k of what the adjusted orientations contribute to the differences of
`orientation_differences` has the error e_k = F_k dEO, with the joint covariance of all strips

    Cov(e_k, e_l) = σ0² F_k Q F_lᵀ + F_k G Σ_c Gᵀ F_lᵀ,    G = −Q Aᵀ P A_c.

Q is the full cofactor matrix of the adjustment (one solution with the factors that are there for each strip
and component) and Σ_c the covariance of the camera's parameters c that were calibrated before and held here.
What is common to all strips does not show in their scatter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.calibration.strip_offsets import body_fixed
from adjust.georeferencing.error_sources import CalibrationErrors
from adjust.one_thread import one_thread
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT
from adjust.result import AdjustmentResult
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System

# Right-hand sides at once: each is as large as all exposures.
_AT_ONCE = 60


@dataclass(frozen=True, eq=False)
class StripErrors:
    """Errors of the means of s strips that come from the adjusted orientations.

    Attributes
    ----------
    covariance : (s, 6, s, 6) of roll, pitch, yaw (radians) and east, north, up (metres), with the signs the
        differences have.
    """

    covariance: Floats

    def only(self, strips: Bools | Ints) -> StripErrors:
        """The errors of some of the strips."""
        return StripErrors(self.covariance[strips][:, :, strips])

    def of_components(self, heading: Floats) -> Floats:
        """(9, s, s) between the strips, of each of the nine components; body axes as at headings (s,)."""
        s = len(heading)
        found = np.zeros((9, s, s))
        for k in range(6):
            found[k if k < 3 else k + 3] = self.covariance[:, k, :, k]
        found[5] = found[8]
        turned = body_fixed(heading, np.arange(s)).T @ self.in_plan() @ body_fixed(heading, np.arange(s))
        found[3], found[4] = turned[::2, ::2], turned[1::2, 1::2]
        return found

    def in_plan(self) -> Floats:
        """(2 s, 2 s) of east and north of each strip, one after the other."""
        s = len(self.covariance)
        return np.asarray(self.covariance[:, 3:5, :, 3:5].reshape(2 * s, 2 * s))


def adjusted_strip_errors(
    block: Block,
    result: AdjustmentResult,
    strip: Ints,
    local_from_enu: Floats,
    cameras: CalibrationErrors | None = None,
    sigma0: float = 1.0,
) -> StripErrors:
    """Errors of the strips' means of an adjustment.

    Parameters
    ----------
    strip : (n,) number of the strip of each image, 0 … s − 1; −1: of none.
    local_from_enu : (n, 3, 3).
    cameras : errors of camera parameters that were held; None: none.
    """
    system, solution = result.system, result.solution
    of_strips = _functionals(block, strip, local_from_enu)
    s = int(strip.max(initial=-1)) + 1
    with one_thread():
        covariance = sigma0**2 * _products(solution, of_strips, strip, s)
        if cameras is not None and len(cameras.covariance):
            moved = _sums(of_strips, _moved_by(system, solution, cameras), strip, s).reshape(6 * s, -1)
            covariance = covariance + moved @ cameras.covariance @ moved.T
    return StripErrors(covariance.reshape(s, 6, s, 6))


def _functionals(block: Block, strip: Ints, local_from_enu: Floats) -> Floats:
    """(n, 6, 6) share of each image in the components of its strip, by the elements of its orientation."""
    functional = np.zeros((len(strip), 6, 6))
    functional[:, :3, 3:] = block.body_from_camera
    functional[:, 3:, :3] = -np.swapaxes(local_from_enu, 1, 2)
    count = np.bincount(strip[strip >= 0], minlength=1)
    share = np.where(strip >= 0, 1.0 / count[np.maximum(strip, 0)], 0.0)
    return functional * share[:, None, None]


def _sums(of_strips: Floats, exposures: Floats, strip: Ints, s: int) -> Floats:
    """F x (s, 6, d) of vectors (n, 6, d) at the exposures."""
    found = np.zeros((s, 6, exposures.shape[2]))
    own = strip >= 0
    np.add.at(found, strip[own], of_strips[own] @ exposures[own])
    return found


def _products(solution: Solution, of_strips: Floats, strip: Ints, s: int) -> Floats:
    """F Q Fᵀ (6 s, 6 s)."""
    g = len(solution.normals.corner)
    found = np.zeros((6 * s, 6 * s))
    for first in range(0, 6 * s, _AT_ONCE):
        columns = np.arange(first, min(first + _AT_ONCE, 6 * s))
        right = np.zeros((len(strip), 6, len(columns)))
        for place, column in enumerate(columns):
            own = np.flatnonzero(strip == column // 6)
            right[own, :, place] = of_strips[own, column % 6]
        exposures, _ = solution.factorization.factor.solve(right, np.zeros((g, len(columns))))
        found[:, columns] = _sums(of_strips, exposures, strip, s).reshape(6 * s, -1)
    return 0.5 * (found + found.T)


def _moved_by(system: System, solution: Solution, cameras: CalibrationErrors) -> Floats:
    """G (n, 6, k): what errors of held camera parameters do to the exposures."""
    rays, layout, k = system.observations.image_points, system.layout, len(cameras.covariance)
    equations = rays.linearize(solution.linearization)
    of = {term.block: term for term in equations.terms}
    column = np.zeros((*equations.misclosure.shape, k))
    for name, places in cameras.columns.items():
        if name in of:
            held = places[of[name].index]
            for component in range(held.shape[1]):
                rows = np.flatnonzero(held[:, component] >= 0)
                column[rows, :, held[rows, component]] += of[name].jacobian[rows, :, component]
    weighted = -column * rays.inverse_sigma[:, :, None] ** 2
    right = FullVectors(
        np.zeros((layout.events, 6, k)), np.zeros((system.border, k)), np.zeros((layout.points, 3, k))
    )
    for name, target in ((EXTERIOR_ORIENTATION, right.of_exposures), (OBJECT_POINT, right.of_points)):
        np.add.at(target, of[name].index, np.swapaxes(of[name].jacobian, 1, 2) @ weighted)
    return solve_full(system, solution.linearization, solution.factorization, right).of_exposures
