"""Simulated flights that are adjusted on control alone, beside their GNSS and INS."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats
from adjust.calibration.adjusted_strips import StripErrors, adjusted_strip_errors
from adjust.calibration.orientation_differences import (
    OrientationDifferences,
    OrientationPairs,
    orientation_differences,
)
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from tests.adjust.simulate.specifications import CAMERA, HEIGHT, NOISE, small_specification, without_noise

ONE_THREAD = AdjustmentOptions(threads=1)
#: Observations of GNSS and INS take no part in the first step.
OBSERVED = ("gnss_positions", "ins_attitudes")
EXPOSURES = 5
FIVE_BY_FIVE = SurveyLayout("grid", columns=5, rows=5)
INS_OF_STRIPS = replace(
    NOISE,
    ins=(np.deg2rad(0.001), np.deg2rad(0.001), np.deg2rad(0.002)),
    ins_markov=(np.deg2rad(0.003), np.deg2rad(0.003), np.deg2rad(0.006)),
    ins_correlation_time=1e4,
)


@dataclass(frozen=True, eq=False)
class TwoStepFlight:
    """A flight whose boresight, lever arm and shift are zero.

    Attributes
    ----------
    simulated : the flight without noise.
    errors : of the strips' means, from the adjustment on control alone.
    pair_covariance : (n, 6, 6) of its differences, adjusted and observed together.
    """

    simulated: SimulatedBlock
    errors: StripErrors
    pair_covariance: Floats

    def differences(self, flown: SimulatedBlock) -> OrientationDifferences:
        """Adjusted minus observed orientations of a flight."""
        block = flown.block()
        state = estimate_block(block, flown.observations(block, OBSERVED), ONE_THREAD).state
        return _differences(flown, state, self.pair_covariance)


def two_step_flight(strips: int, survey: SurveyLayout = FIVE_BY_FIVE) -> TwoStepFlight:
    """A flight of so many strips of five images, half of them across the others.

    Errors of GNSS (3 cm) and INS (0.003, 0.003, 0.006°) last as long as a strip.
    """
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.6)
    lines = (EXPOSURES,) * (strips // 2)
    specification = small_specification(
        flight=(
            LineGroup("E", "1", 0, np.pi / 2, HEIGHT, lines, base, spacing),
            LineGroup("N", "1", 0, 0.0, HEIGHT, lines, base, spacing),
        ),
        points=PointSpecification(count=40 * strips),
        survey=(survey,),
        noise=INS_OF_STRIPS,
        system=SystemSpecification(strip_bias=(0.03, 0.03, 0.03)),
    )
    calm = simulate_block(without_noise(specification))
    block = calm.block()
    result = adjust_block(block, calm.observations(block, OBSERVED), ONE_THREAD)
    axes = np.array(calm.specification.frame.local_from_enu(block.projection_centre))
    errors = adjusted_strip_errors(block, result, calm.truth.plan.strip, axes)
    mounting = block.body_from_camera
    of_exposures = result.cofactor.reduced.of_exposures
    turn = np.zeros((len(mounting), 6, 6))
    turn[:, :3, 3:], turn[:, 3:, :3] = mounting, np.eye(3)
    observed = np.diag(np.concatenate([INS_OF_STRIPS.stated_ins**2, np.array(NOISE.gnss) ** 2]))
    covariance = turn @ of_exposures @ np.swapaxes(turn, 1, 2) + observed
    return TwoStepFlight(simulate_block(specification), errors, covariance)


def _differences(flown: SimulatedBlock, state: State, covariance: Floats) -> OrientationDifferences:
    plan, measured = flown.truth.plan, flown.measured
    block = flown.block()
    pairs = OrientationPairs(
        state.projection_centre,
        state.local_from_camera,
        measured.positions,
        measured.local_from_body,
        block.body_from_camera,
        np.array(flown.specification.frame.local_from_enu(measured.positions)),
    )
    height = np.full(len(plan.strip), HEIGHT)
    return orientation_differences(
        pairs, plan.strip, plan.flight, flown.truth.trajectory.time, height, covariance
    )
