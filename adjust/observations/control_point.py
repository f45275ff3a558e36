"""Control points: surveyed coordinates of object points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_sigmas, require_shape
from adjust.geometry.earth import LocalFrame
from adjust.observations.base import Linearization, StochasticModel, Term, require_rows, require_values
from adjust.parameters import OBJECT_POINT, State, Unit
from adjust.unknown_names import indices_of

if TYPE_CHECKING:
    from adjust.block import Block


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

    def __post_init__(self) -> None:
        require_rows(self, ("point",), given=(3,), given_height=())
        in_plan, in_height = np.isfinite(self.given).all(axis=1), np.isfinite(self.given_height)
        require_values(self, np.stack([in_plan, in_plan, in_height], axis=1))

    @classmethod
    def surveyed(cls, block: Block, point: ArrayLike, given: ArrayLike, sigma: ArrayLike) -> Self:
        """Points surveyed in full, in plan only, or in height only.

        Parameters
        ----------
        point : (n,) names, or indices, of object points of the block.
        given : (n, 3) metres, local frame. Of a point known in plan only any place on its vertical; of one
            known in height only any place of that height.
        sigma : east, north, up, metres, NaN of what was not surveyed; a number, or an array that broadcasts
            to (n, 3).

        Raises
        ------
        InconsistentBlockError : of other shapes or values.
        UnknownNameError : the block has no such object point.
        """
        index, x = indices_of("object point", point, block.points), np.asarray(given, dtype=np.float64)
        require_shape("The array of surveyed positions", x.shape, (len(index), 3))
        weights = StochasticModel.from_sigma(as_sigmas(sigma, x.shape))
        plan, up = weights.present[:, :2].any(axis=1, keepdims=True), weights.present[:, 2]
        height = np.where(up, block.frame.height(x), np.nan)
        return cls(index, np.where(plan, x, np.nan), height, block.frame, weights)

    @property
    def event(self) -> Ints:
        """−1 for every control point: it belongs to no event."""
        return np.full(len(self.point), -1, dtype=np.int64)

    @cached_property
    def _axes_at_given(self) -> Floats | None:
        """(n, 3, 3) of `LocalFrame.local_from_enu`; None: positions are not all given in full."""
        return self.frame.local_from_enu(self.given) if np.isfinite(self.given).all() else None

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state; derivatives exact except for the curvature of h (1/R)."""
        x_in_local = state.object_point[self.point]
        height, axes = self.frame.height_and_axes(x_in_local)
        anchor = np.where(np.isfinite(self.given), self.given, x_in_local)
        in_full = self._axes_at_given
        local_from_enu = self.frame.local_from_enu(anchor) if in_full is None else in_full
        enu = np.einsum("nji,nj->ni", local_from_enu, x_in_local - anchor)
        jacobian = np.swapaxes(local_from_enu, 1, 2).copy()
        enu[:, 2] = np.nan_to_num(height - self.given_height)
        # The gradient of the height is the vertical at X, not at the surveyed position.
        jacobian[:, 2, :] = axes[:, :, 2]
        return Linearization(-enu, (Term(OBJECT_POINT, self.point, jacobian),))

    def without(self, rejected: Bools) -> Self:
        """The same group with the points (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))
