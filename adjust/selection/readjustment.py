"""The same observations adjusted again and again with other corrections of the image points, values only.

Which observations are used, and with which weights, is taken from a complete adjustment; each further
one starts from the last one's values, so that one or two iterations suffice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.observations.image_point import ImagePoints
from adjust.one_thread import one_thread
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.result import AdjustmentResult
from adjust.solve.gauss_newton import converge
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class Readjusted:
    """Values of one of these adjustments.

    Attributes
    ----------
    state : adjusted values.
    sigma0 : a posteriori / a priori; NaN without redundancy.
    residual : (n, 2) of the image points, adjusted − (observed + correction), metres.
    """

    state: State
    sigma0: float
    residual: Floats

    @classmethod
    def of(cls, result: AdjustmentResult) -> Self:
        """Those of a complete adjustment."""
        return cls(result.state, result.test.sigma0, result.groups[0].residual)


@dataclass(frozen=True, eq=False)
class Readjustment:
    """What stays the same from one of these adjustments to the next.

    Attributes
    ----------
    system : unknowns and the observations that were used, with the weights they had.
    most_iterations : of one adjustment.
    defect : number of open movements of a free network.
    """

    system: System
    most_iterations: int
    defect: int = 0

    @classmethod
    def of(cls, block: Block, result: AdjustmentResult, options: AdjustmentOptions) -> Self:
        """What was used in an adjustment of a block."""
        system = System.of(block, result.observations, options.threads, options.free_network)
        defect = 0 if result.free_network is None else result.free_network.defect
        return cls(system, options.most_iterations, defect)

    @property
    def image_points(self) -> ImagePoints:
        """The image points as they are measured."""
        return self.system.observations.image_points

    def adjust(self, rays: ImagePoints, start: State) -> Readjusted:
        """Adjust with these image points in the place of the first ones, from the values of a state.

        Raises
        ------
        DatumDefectError, DivergenceError : as of ``adjust_block``.
        """
        observations = replace(self.system.observations, image_points=rays)
        system = self.system.remaining(observations)
        with one_thread():
            estimate = converge(system, start, self.most_iterations)
        r = system.redundancy + self.defect
        sigma0 = float(np.sqrt(estimate.weighted_squares / r)) if r > 0 else float("nan")
        return Readjusted(estimate.state, sigma0, -rays.misclosure(estimate.state))
