"""Flights that are calibrated, and georeferenced directly with what the calibration found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from adjust.adjustment import adjust_block, estimate_block
from adjust.approximate.intersection import intersect
from adjust.arrays import Floats, Ints
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources, SharedErrors
from adjust.georeferencing.sensitivity import Sensitivity
from adjust.georeferencing.space_intersection import point_errors
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.options import AdjustmentOptions
from adjust.parameters import GNSS_DRIFT, GNSS_STRIP_BIAS
from adjust.quality.parameter_influences import ParameterInfluence, parameter_influences
from adjust.simulate.block import SimulatedBlock
from tests.adjust.georeferencing.flights import fly

ONE_THREAD = AdjustmentOptions(threads=1)
_OF_STRIPS = (GNSS_STRIP_BIAS, GNSS_DRIFT)


@dataclass(frozen=True, eq=False)
class CalibratedFlight:
    """A flight without noise: what its calibration is predicted to leave of errors.

    Attributes
    ----------
    simulated : the flight; its stated standard deviations are those of the flights drawn.
    free : families the calibration estimates.
    errors : of the calibration, with what it shares with its own flight.
    """

    simulated: SimulatedBlock
    free: tuple[str, ...]
    errors: CalibrationErrors

    @property
    def control(self) -> Ints:
        """(c,) object points that are control."""
        truth = self.simulated.truth
        return truth.surveyed[~truth.is_check]

    def predicted(self, *, same_flight: bool, at_control: bool = False) -> tuple[Floats, Sensitivity]:
        """Variance (m, 3) by image points, and sensitivity of all intersected points to everything else.

        Parameters
        ----------
        at_control : of the differences of the c control points from their survey.
        """
        errors = self.errors if same_flight else replace(self.errors, shared=None)
        flight = fly(self.simulated)
        common = np.append(self.simulated.specification.system.strip_bias, np.zeros(3))
        sources = ErrorSources(flight.orientations, self.simulated.truth.plan.strip, common, errors)
        points = flight.intersected()
        axes = np.broadcast_to(np.eye(3), (len(points), 3, 3))
        found = point_errors(flight.rays, sources, points, axes)
        by_image_points = np.diagonal(found.by_image_points, axis1=1, axis2=2)
        if not at_control:
            return by_image_points, found.sensitivity
        chosen = self.control
        of_control = found.sensitivity.only((3 * chosen[:, None] + np.arange(3)).ravel())
        assert errors.shared is not None
        survey = scipy.sparse.csr_array(scipy.sparse.block_diag(list(-errors.shared.survey_spread)))
        return by_image_points[chosen], replace(of_control, survey=survey)

    def points(self, own: SimulatedBlock, flown: SimulatedBlock) -> Floats:
        """Errors (m, 3) of the points of a flight, with the calibration of its own or another flight."""
        block = own.block(self.free)
        system = dict(estimate_block(block, own.observations(block), ONE_THREAD).state.system)
        for name in _OF_STRIPS:
            system[name] = np.zeros_like(flown.truth.state.system[name])
        flight = replace(fly(flown), system=system)
        count = len(flown.truth.points)
        found = intersect(flight.rays, flight.orientations.state, count)
        return found.object_point - flown.truth.state.object_point


def calibrated_flight(calm: SimulatedBlock, free: tuple[str, ...]) -> CalibratedFlight:
    """Calibrate a flight without noise."""
    block = calm.block(free)
    result = adjust_block(block, calm.observations(block), ONE_THREAD)
    kept = {
        name: columns
        for name, columns in result.layout.columns.items()
        if name not in _OF_STRIPS and (columns >= 0).any()
    }
    chosen = np.concatenate([columns[columns >= 0] for columns in kept.values()])
    place = np.full(result.layout.border, -1)
    place[chosen] = np.arange(len(chosen))
    columns = {name: np.where(c >= 0, place[c], -1) for name, c in kept.items()}
    covariance = result.cofactor.reduced.corner[np.ix_(chosen, chosen)]
    shared = shared_errors(calm, parameter_influences(result, chosen))
    return CalibratedFlight(calm, free, CalibrationErrors(columns, covariance, shared))


def shared_errors(calm: SimulatedBlock, influences: tuple[ParameterInfluence, ...]) -> SharedErrors:
    """What a calibration shares with its own flight, weighted as stated."""
    of = {item.group.name: item for item in influences}
    positions, attitudes = of["gnss_positions"].derivative, of["ins_attitudes"].derivative
    n = positions.shape[1]
    control = of[ControlPoints.name]
    sigma = np.nan_to_num(control.group.stochastic.sigma)
    strips = np.zeros((int(calm.truth.plan.strip.max()) + 1, 6))
    biases = of.get(f"prior:{GNSS_STRIP_BIAS}")
    if biases is not None:
        assert isinstance(biases.group, DirectObservations)
        strips[:, :3] = biases.group.stochastic.sigma
    return SharedErrors(
        np.concatenate([positions, attitudes], axis=2),
        control.derivative,
        sigma[:, :, None] * np.eye(3),
        np.ones((n, 6)),
        strips,
        np.ones_like(sigma),
    )
