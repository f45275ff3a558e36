"""Control points: surveyed coordinates of object points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry.earth import LocalFrame
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import OBJECT_POINT, State, Unit


@dataclass(frozen=True, eq=False)
class ControlPoints:
    """Surveyed points: full, in plan only, in height only, or with a full covariance matrix.

    The observation is zero when the object point X lies at the surveyed position, in the local
    axes east, north, up at that position:

        (east, north) = C · (X − G),    up = h(X) − h_given

    G is any point of the vertical through the surveyed plan position (the vertical is a straight
    line, so a point known in plan only needs no height), and h the height above the reference
    surface (so a point known in height only needs no plan position; C is then that of X itself).

    Attributes
    ----------
    point : (n,) index of the object point.
    given : (n, 3) surveyed position in local axes, metres; NaN for a point known in height only.
    given_height : (n,) surveyed height in the frame's sense, metres; NaN if unknown.
    frame : the local frame, which knows what is up.
    stochastic : components east, north, up.
    """

    point: Ints
    given: Floats
    given_height: Floats
    frame: LocalFrame
    stochastic: StochasticModel

    name: ClassVar[str] = "control_points"
    components: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    unit: ClassVar[Unit] = "m"

    @property
    def event(self) -> Ints:
        """−1 for every control point: it belongs to no event."""
        return np.full(len(self.point), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state; derivatives exact except for the curvature of h (1/R)."""
        x_in_local = state.object_point[self.point]
        anchor = np.where(np.isfinite(self.given), self.given, x_in_local)
        local_from_enu = self.frame.local_from_enu(anchor)
        enu = np.einsum("nji,nj->ni", local_from_enu, x_in_local - anchor)
        jacobian = np.swapaxes(local_from_enu, 1, 2).copy()
        enu[:, 2] = np.nan_to_num(self.frame.height(x_in_local) - self.given_height)
        # The gradient of the height is the vertical at X, not at the surveyed position.
        jacobian[:, 2, :] = self.frame.local_from_enu(x_in_local)[:, :, 2]
        return Linearization(-enu, (Term(OBJECT_POINT, self.point, jacobian),))

    def without(self, rejected: Bools) -> Self:
        """The same group with the points (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))
