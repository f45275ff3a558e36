"""Platform calibration: rotations of the heads of a camera whose pictures are composed to a virtual image.

Points that two heads see at one exposure must fall on one place of the virtual image:

    x_v(head a) − x_v(head b) + v = 0,    Σ_v = s² (J_a J_aᵀ + J_b J_bᵀ)

with the derivatives J of `adjust.camera.virtual_image`. The positions of the heads are known. Turning all
heads together changes nothing but the platform, so the mean rotation against the given ones is zero,
Σ_h μ_h = 0, and with free focal lengths Σ_h dc_h = 0. The same datum is given to rotations from an adjustment
of a flight, so that both can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy import special
from scipy.sparse.csgraph import connected_components

from adjust.arrays import Floats, Ints
from adjust.camera.virtual_image import PlatformHeads, composed
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation

_ITERATIONS = 20
# Rotations in radians; a focal length is as well determined by micrometres.
_CONVERGED = 1e-12
# Parts of the largest singular value below which a direction is open.
_OPEN = 1e-9
# Two points give the three rotations of one head against another.
_FEWEST_POINTS = 2


@dataclass(frozen=True, eq=False)
class Ties:
    """Points that two heads see at one exposure.

    Attributes
    ----------
    head : (n, 2) the two heads.
    xy : (n, 2, 2) ideal image coordinates in each, metres.
    distance : (n,) of the ground below the platform, metres.
    sigma : of an image coordinate, metres.
    """

    head: Ints
    xy: Floats
    distance: Floats
    sigma: float

    def only(self, rows: Ints) -> Ties:
        """Some of them."""
        return replace(self, head=self.head[rows], xy=self.xy[rows], distance=self.distance[rows])


@dataclass(frozen=True, eq=False)
class PlatformCalibration:
    """Rotations, and if wanted focal lengths, of the heads.

    Attributes
    ----------
    heads : as calibrated.
    change : (h, 3) small rotations μ against the given heads, axes of the platform, radians.
    focal_length_change : (h,) metres; zero where they are held.
    covariance : (k, k) of μ of all heads, then of all focal lengths if they are free, with σ0 = 1.
    sigma0 : from the residuals; NaN without redundancy.
    redundancy : degrees of freedom.
    residual : (n, 2) steps between the heads that are left in the virtual image, metres.
    """

    heads: PlatformHeads
    change: Floats
    focal_length_change: Floats
    covariance: Floats
    sigma0: float
    redundancy: int
    residual: Floats

    @property
    def sigma(self) -> Floats:
        """(h, 3) standard deviations of the small rotations, radians."""
        count = self.change.size
        return np.asarray(np.sqrt(np.diagonal(self.covariance)[:count]).reshape(self.change.shape))

    @property
    def correlation(self) -> Floats:
        """(k, k) correlation matrix."""
        own = np.sqrt(np.diagonal(self.covariance))
        return np.asarray(self.covariance / np.outer(own, own))

    def probability(self, head: int) -> float:
        """Probability of so large a change of a head by chance: χ² with three degrees of freedom."""
        own = slice(3 * head, 3 * head + 3)
        size = self.change[head] @ np.linalg.solve(self.covariance[own, own], self.change[head])
        return float(special.chdtrc(3, size))


def calibrate_platform(
    given: PlatformHeads, ties: Ties, *, focal_lengths: bool = False
) -> PlatformCalibration:
    """Calibrate the heads from the overlaps of their pictures.

    Raises
    ------
    InconsistentBlockError : if the overlaps do not join all heads, or do not determine the focal lengths.
    """
    count = len(given)
    _refuse_heads_apart(count, ties)
    basis = _datum_basis(count, focal_lengths)
    small, longer = np.zeros((count, 3)), np.zeros(count)
    heads = given
    for _ in range(_ITERATIONS):
        misclosure, design = _whitened(heads, ties, focal_lengths)
        step = basis @ _solved(design @ basis, misclosure)
        heads = heads.turned(step[: 3 * count].reshape(-1, 3))
        if focal_lengths:
            heads = heads.longer(step[3 * count :])
            longer = longer + step[3 * count :]
        if np.abs(step[: 3 * count]).max() < _CONVERGED:
            break
    heads = replace(
        heads, platform_from_head=with_mean_rotation(heads.platform_from_head, given.platform_from_head)
    )
    small = _small(heads.platform_from_head, given.platform_from_head)
    misclosure, design = _whitened(heads, ties, focal_lengths)
    reduced = design @ basis
    covariance = basis @ np.linalg.inv(reduced.T @ reduced) @ basis.T
    redundancy = len(misclosure) - basis.shape[1]
    sigma0 = float(np.sqrt(misclosure @ misclosure / redundancy)) if redundancy > 0 else float("nan")
    return PlatformCalibration(heads, small, longer, covariance, sigma0, redundancy, _steps(heads, ties)[0])


def with_mean_rotation(turn: Floats, given: Floats) -> Floats:
    """Rotations (h, 3, 3), platform from head, turned together: their mean change against given is zero."""
    for _ in range(_ITERATIONS):
        mean = _small(turn, given).mean(axis=0)
        turn = rotation.exp(-mean[None])[0] @ turn
        if np.abs(mean).max() < _CONVERGED:
            break
    return np.asarray(turn)


def covariance_with_mean_rotation(covariance: Floats) -> Floats:
    """Covariance (3h, 3h) of small rotations μ in the datum Σ μ_h = 0: S C Sᵀ (Baarda 1973)."""
    basis = _datum_basis(len(covariance) // 3, False)
    transformation = basis @ basis.T
    return transformation @ covariance @ transformation.T


def joint_test(error: Floats, covariance: Floats) -> tuple[float, int]:
    """χ² of errors (3h,) whose covariance has the defect of the datum, and its degrees of freedom."""
    scale = np.sqrt(np.trace(covariance) / len(covariance))
    values, vectors = np.linalg.eigh(covariance / scale**2)
    kept = values > _OPEN * values[-1]
    projected = vectors[:, kept].T @ error / scale
    return float(np.sum(projected**2 / values[kept])), int(kept.sum())


def _small(turn: Floats, given: Floats) -> Floats:
    return np.asarray(rotation.log(turn @ np.swapaxes(given, 1, 2)))


def _datum_basis(count: int, focal_lengths: bool) -> Floats:
    """Orthonormal basis (k, d) of all changes with Σ μ_h = 0 and Σ dc_h = 0."""
    constraint = np.tile(np.eye(3), count)
    if focal_lengths:
        constraint = scipy.linalg.block_diag(constraint, np.ones((1, count)))
    return np.asarray(scipy.linalg.null_space(constraint))


def _steps(heads: PlatformHeads, ties: Ties) -> tuple[Floats, Floats, Floats]:
    """Steps x_v(a) − x_v(b) (n, 2), their derivatives (n, 2, 4h) and covariances (n, 2, 2)."""
    n, count = len(ties.distance), len(heads)
    step, design = np.zeros((n, 2)), np.zeros((n, 2, 4 * count))
    covariance = np.zeros((n, 2, 2))
    rows = np.arange(n)
    for side, sign in ((0, 1.0), (1, -1.0)):
        head = ties.head[:, side]
        found = composed(heads, head, ties.xy[:, side], ties.distance)
        step += sign * found.xy
        for axis in range(3):
            design[rows, :, 3 * head + axis] += sign * found.of_rotation[:, :, axis]
        design[rows, :, 3 * count + head] += sign * found.of_focal_length
        covariance += ties.sigma**2 * found.of_point @ np.swapaxes(found.of_point, 1, 2)
    return step, design, covariance


def _whitened(heads: PlatformHeads, ties: Ties, focal_lengths: bool) -> tuple[Floats, Floats]:
    """Misclosures (2n,) and design matrix (2n, k) of unit weight."""
    step, design, covariance = _steps(heads, ties)
    if not focal_lengths:
        design = design[:, :, : 3 * len(heads)]
    root = np.linalg.cholesky(covariance)
    joint = np.linalg.solve(root, np.concatenate([-step[:, :, None], design], axis=2))
    joint = joint.reshape(-1, joint.shape[2])
    return joint[:, 0], joint[:, 1:]


def _refuse_heads_apart(count: int, ties: Ties) -> None:
    """Every head must hang together with all others by at least two points.

    Known positions hide it where one does not: pivots look sound, and σ is some degrees.
    """
    pairs = np.zeros((count, count))
    np.add.at(pairs, (ties.head[:, 0], ties.head[:, 1]), 1)
    if connected_components(pairs >= _FEWEST_POINTS, directed=False)[0] > 1:
        raise InconsistentBlockError(
            "The points in the overlaps do not join all heads: each needs at least two points in common "
            "with another one."
        )


def _solved(design: Floats, misclosure: Floats) -> Floats:
    """Least squares, refused where a direction is open."""
    scale = np.linalg.norm(design, axis=0)
    sizes = np.linalg.svd(design / np.where(scale > 0.0, scale, 1.0), compute_uv=False)
    if len(design) < design.shape[1] or np.any(scale == 0.0) or sizes[-1] < _OPEN * sizes[0]:
        raise InconsistentBlockError("The points in the overlaps do not determine what is free of the heads.")
    return np.asarray(scipy.linalg.lstsq(design, misclosure)[0])
