"""Radial distortion of a calibration report as an interior orientation with Brown's parameters.

A report states the radial displacement d of images at some distances r from the point of symmetry, as a mean
or along several semi-diagonals. The correction Δ of `adjust.camera.additional.brown` removes it; along the
direction θ of a semi-diagonal it is

    −d = K0 r + K1 r³ + K2 r⁵ + K3 r⁷ + 3 r² (P1 cos θ + P2 sin θ),

which is Brown's formula but for K0 (Tayman 1978, Analytical multicollimator camera calibration,
Photogrammetria 34, 179–197, has K0). K0 only changes the scale: with c / (1 + K0) in place of the calibrated
focal length c, and the other parameters divided by 1 + K0, it is gone.

P1 and P2 are fitted to semi-diagonals, or where the point of symmetry is not the principal point: to the
first order, K1 r³ about a point at s is K1 r³ with (P1, P2) = −K1 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.brown import SET
from adjust.errors import InconsistentBlockError

_RADIAL, _DECENTRING = ("K1", "K2", "K3"), ("P1", "P2")
# A mean holds for all directions; these represent them.
_DIRECTIONS = np.arange(8) * (np.pi / 4.0)
# Probability of a misfit that chance exceeds: with less, one more term is needed.
_LEVEL = 0.05


@dataclass(frozen=True, eq=False)
class RadialDistortion:
    """Stated distortion; lengths in metres.

    Attributes
    ----------
    radius : (n,) distances from the point of symmetry.
    direction : (m,) of the semi-diagonals, radians from +x, counter-clockwise; empty: means of all
        directions.
    outward : (n, m) displacement of the image away from the point of symmetry; (n, 1) of means.
    sigma : standard deviation of a stated value.
    centre : (2,) the point of symmetry relative to the principal point.
    """

    radius: Floats
    direction: Floats
    outward: Floats
    sigma: float
    centre: Floats


@dataclass(frozen=True, eq=False)
class FittedDistortion:
    """Interior orientation that reproduces a stated distortion; lengths in metres.

    Attributes
    ----------
    focal_length : c / (1 + K0).
    names, values : of Brown's parameters, as in `adjust.camera.additional.brown.SET`.
    residual : (n, m) fitted − stated displacement.
    fits : whether the residuals agree with σ at 5 %.
    redundancy : number of stated values − number of parameters.
    """

    focal_length: float
    names: tuple[str, ...]
    values: Floats
    residual: Floats
    fits: bool
    redundancy: int

    @property
    def rms(self) -> float:
        """RMS misfit of the stated values."""
        return float(np.sqrt(np.mean(self.residual**2)))


def fit_distortion(stated: RadialDistortion, focal_length: float) -> FittedDistortion:
    """The fewest parameters that agree with the stated values; all three K if none of them do.

    Raises
    ------
    InconsistentBlockError
        If there are fewer stated values than parameters.
    """
    shifted = bool(np.any(stated.centre))
    semi_diagonals = len(stated.direction) > 0
    extra = _DECENTRING if semi_diagonals or shifted else ()
    # A mean says nothing of a decentring: its P1, P2 follow from the centre alone.
    spent = 1 + (len(extra) if semi_diagonals else 0)
    if stated.outward.size <= spent:
        raise InconsistentBlockError("The radial distortion has fewer values than parameters.")
    found = None
    for terms in range(len(_RADIAL) + 1):
        redundancy = stated.outward.size - spent - terms
        if len(stated.radius) <= terms or redundancy < 0:
            break
        names = (*_RADIAL[:terms], *(extra if terms or semi_diagonals else ()))
        found = _fitted(stated, focal_length, names, redundancy)
        if found.fits:
            break
    assert found is not None  # K0 alone has a redundancy
    return found


def _fitted(
    stated: RadialDistortion, focal_length: float, names: tuple[str, ...], redundancy: int
) -> FittedDistortion:
    """The fit with these parameters and K0."""
    n, m = stated.outward.shape
    direction = stated.direction if len(stated.direction) else _DIRECTIONS
    unit = np.column_stack([np.cos(direction), np.sin(direction)])
    xy = (stated.centre + stated.radius[:, None, None] * unit).reshape(-1, 2)
    along = np.tile(unit, (n, 1))
    no_format = ImageFormat(0.0, 0.0)
    columns = [(xy * along).sum(axis=1), *np.einsum("pi,pik->kp", along, SET.basis(xy, no_format, names))]
    design = np.stack(columns, axis=1)
    size = np.abs(design).max(axis=0)
    displacement = np.repeat(stated.outward, len(direction) // m, axis=1).ravel()
    solution = np.linalg.lstsq(design / size, -displacement, rcond=None)[0] / size
    residual = (-(design @ solution) - displacement).reshape(n, m, -1).mean(axis=2)
    chi_square = float(np.sum((residual / stated.sigma) ** 2))
    fits = chi_square <= float(special.chdtri(redundancy, _LEVEL)) if redundancy else True
    scale = 1.0 + solution[0]
    return FittedDistortion(
        focal_length / scale, names, np.asarray(solution[1:] / scale), residual, fits, redundancy
    )
