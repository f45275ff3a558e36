"""Distortion from the ideal to the measured image point, and its inverse.

With the ideal point as a direction u = (x_id, y_id) / c a forward set of additional parameters says

    (x̄ + Δ) / c = u + d(u),

without a length in it: d depends on the values of the parameters alone. In metres the distortion is
D = c d(x_id / c), with ∂D/∂x_id = ∂d/∂u and ∂(x_id + D)/∂c = u + d for a point that is projected, x_id = c u.
A set states D for the focal length c₀ of its image format, so d(u) = D₀(c₀ u) / c₀.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.camera.additional.evaluation import Correction, slope_of, total_correction
from adjust.camera.additional.register import AdditionalParameters

_MOST_STEPS = 30
_SETTLED = 1e-14  # some 1e-15 m in the image
_LONGEST_STEP = 0.3
# Below it the distortion is about to fold the image over: no measured point has one ideal point there.
_LEAST_DETERMINANT = 1e-2


@dataclass(frozen=True)
class Distortion:
    """The forward sets among the additional parameters of a camera, as functions of directions.

    Attributes
    ----------
    parameters : of forward sets only.
    """

    parameters: AdditionalParameters

    @classmethod
    def of(cls, parameters: AdditionalParameters) -> Distortion:
        """Those of the forward sets among additional parameters."""
        return cls(parameters.only("forward"))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name ``SET:NAME`` of each of the k parameters."""
        return self.parameters.names

    @property
    def first(self) -> Bools:
        """(k,) which of them come first."""
        return self.parameters.first

    def basis(self, xy: Floats) -> Floats:
        """Distortions d (n, 2, k) for each unit, at directions (n, 2).

        Raises
        ------
        AdditionalParametersError : the image format has no focal length.
        """
        if not self.names:
            return np.zeros((len(xy), 2, 0))
        c = self.parameters.image_format.needed_focal_length
        return self.parameters.basis(c * xy) / c


def undistorted(distortion: Correction, distorted: Floats, values: Floats) -> tuple[Floats, Bools]:
    """Directions u (n, 2) with u + d(u) as given (n, 2), and whether each was found (n,).

    By Newton's method. Not found are points in corners where large values fold the image over.
    """

    def d(at: Floats) -> Floats:
        return total_correction(distortion, at, values)

    u = distorted.copy()
    found = np.full(len(u), not np.any(values))
    for _ in range(_MOST_STEPS):
        rows = np.flatnonzero(~found)
        if not len(rows):
            break
        slope = slope_of(d, u[rows]) + np.eye(2)
        regular = np.linalg.det(slope) > _LEAST_DETERMINANT
        missing = distorted[rows] - u[rows] - d(u[rows])
        step = np.linalg.solve(np.where(regular[:, None, None], slope, np.eye(2)), missing[:, :, None])[
            :, :, 0
        ]
        u[rows] += np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        found[rows] = regular & (np.abs(step).max(axis=1) < _SETTLED)
    return u, found
