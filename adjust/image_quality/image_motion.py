"""Movement of the image during an exposure, from the movement of the camera, against the blur of its edges.

A point of level ground at the distance h, seen at the image point (x, y), moves over the image, when the
camera turns with the angular velocity ω and moves with the velocity v (both in camera axes), by

    ẋ = c (ω_y + ω_z y/c − v_x/h) + x (ω_y x − ω_x y)/c − x v_z/h
    ẏ = c (−ω_x − ω_z x/c − v_y/h) + y (ω_y x − ω_x y)/c − y v_z/h

(derivative of x = −c X/Z). Over the exposure time T an edge with the normal n sees s = T (n · (ẋ, ẏ)) of it,
whose second moment s²/12 adds to the square of its blur. Both, the squares of the blurs and those of the
movement, are adjusted with the same model a + b cos 2θ + c sin 2θ as in `smear`, so that their b and c can be
compared although the movement differs over the format; that of the movement as an edge is adjusted with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.image_quality.smear import SmearFit, apparent, fit_smear

#: Movements that are none, px.
_NOTHING = 1e-6


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """How a camera moves while it exposes.

    Attributes
    ----------
    rate, sigma_rate : (3,) angular velocity in camera axes, rad/s.
    velocity_by_height : (3,) velocity in camera axes by the height above ground, 1/s; zero where it is
        compensated.
    exposure, sigma_exposure : time, s.
    focal_length : px.
    """

    rate: Floats
    sigma_rate: Floats
    velocity_by_height: Floats
    exposure: float
    sigma_exposure: float
    focal_length: float

    def by_rate(self, place: Floats) -> Floats:
        """Derivatives (n, 2, 3) of the movement by the angular velocity at image points (n, 2), px·s."""
        x, y = place.T
        c = self.focal_length
        across = np.stack([-x * y / c, c + x * x / c, y], axis=-1)
        along = np.stack([-c - y * y / c, x * y / c, -x], axis=-1)
        return np.asarray(self.exposure * np.stack([across, along], axis=-2))

    def displacement(self, place: Floats) -> Floats:
        """Movement (n, 2) of image points (n, 2) over the exposure, px; y is against rows."""
        u = self.velocity_by_height
        forward = -self.focal_length * u[:2] - place * u[2]
        return np.asarray(self.by_rate(place) @ self.rate + self.exposure * forward)


@dataclass(frozen=True, eq=False)
class MotionComparison:
    """Smear explained by the movement of the camera, compared with that of the edges.

    Attributes
    ----------
    expected, found : of the movement, and of the edges; each with its covariance.
    probability : of such a difference by chance.
    """

    expected: SmearFit
    found: SmearFit
    probability: float


def compared_with_motion(
    angle: Floats, blur: Floats, place: Floats, motion: CameraMotion
) -> MotionComparison | None:
    """Compare the blur of edges with the movement; None if the edges determine no smear (see `smear`).

    Parameters
    ----------
    angle : (n,) of the normals, from increasing columns to increasing rows, rad.
    blur : (n,) σ, px.
    place : (n, 2) image points from the principal point, x along columns, y against rows, px.
    """
    found = fit_smear(angle, blur**2)
    if found is None:
        return None
    # The normal in image axes: rows count against y.
    normal = np.column_stack([np.cos(angle), -np.sin(angle)])
    seen = np.sum(normal * motion.displacement(place), axis=1)
    by_rate = np.einsum("ni,nij->nj", normal, motion.by_rate(place)) * (seen / 6.0)[:, None]
    by_time = seen**2 / (6.0 * motion.exposure)
    derivatives = found.solution[1:] @ np.column_stack([by_rate, by_time])
    variances = np.append(motion.sigma_rate**2, motion.sigma_exposure**2)
    added = np.where(np.abs(seen) > _NOTHING, apparent(np.abs(seen), found.base) - found.base, 0.0)
    amplitude = found.solution @ added
    covariance = (derivatives * variances) @ derivatives.T
    expected = replace(found, amplitude=amplitude[1:], covariance=covariance)
    difference = found.amplitude - expected.amplitude
    together = found.covariance + expected.covariance
    statistic = float(difference @ np.linalg.solve(together, difference)) / 2.0
    return MotionComparison(expected, found, float(special.fdtrc(2, found.freedom, statistic)))
