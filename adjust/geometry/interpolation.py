"""Positions and attitudes between two samples of a trajectory.

Positions: the cubic that has both positions and both velocities (Hermite). Attitudes: R(s) = R₀ exp(φ(s))
with the cubic φ of rotation vectors that has both attitudes and both angular rates: φ(0) = 0, φ̇(0) = ω₀,
φ(h) = log(R₀ᵀ R₁), φ̇(h) = J_r⁻¹(φ(h)) ω₁ (J_r: Barfoot 2017, section 7.1.5). Both errors are of the fourth
order in the interval: h⁴/384 of the fourth derivative in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import exp, log, right_jacobian_inverse


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """n samples, or what lies between them, in one Cartesian frame.

    Attributes
    ----------
    position, velocity : (n, 3) metres, metres per second.
    attitude : (n, 3, 3) frame from body; None: not known.
    rate : (n, 3) of the body about its own axes, radians per second; None as `attitude`.
    """

    position: Floats
    velocity: Floats
    attitude: Floats | None = None
    rate: Floats | None = None


def between(before: Poses, after: Poses, interval: Floats, since: Floats) -> Poses:
    """Poses at times between two samples each.

    Parameters
    ----------
    before, after : the samples of the n times.
    interval : (n,) seconds from the one to the other, positive.
    since : (n,) seconds since the first.
    """
    position, velocity = _hermite(
        before.position, after.position, before.velocity, after.velocity, interval, since
    )
    if before.attitude is None or before.rate is None or after.attitude is None or after.rate is None:
        return Poses(position, velocity)
    turn = log(np.swapaxes(before.attitude, 1, 2) @ after.attitude)
    end = np.einsum("nij,nj->ni", right_jacobian_inverse(turn), after.rate)
    part, change = _hermite(np.zeros_like(turn), turn, before.rate, end, interval, since)
    rate = np.linalg.solve(right_jacobian_inverse(part), change[:, :, None])[:, :, 0]
    return Poses(position, velocity, before.attitude @ exp(part), np.asarray(rate, dtype=np.float64))


def _hermite(
    first: Floats, last: Floats, slope: Floats, end_slope: Floats, interval: Floats, since: Floats
) -> tuple[Floats, Floats]:
    """Values and derivatives (n, 3) of the cubics with given values and derivatives at both ends."""
    h, s = interval[:, None], (since / interval)[:, None]
    rise = last - first
    # In powers of s: first + h slope s + b s² + c s³.
    b = 3.0 * rise - h * (2.0 * slope + end_slope)
    c = h * (slope + end_slope) - 2.0 * rise
    return first + s * (h * slope + s * (b + s * c)), slope + s * (2.0 * b + 3.0 * s * c) / h
