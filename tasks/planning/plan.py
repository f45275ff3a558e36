"""What a flight will determine, and the cheapest addition that makes it a calibration flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern, flight_pattern
from adjust.errors import AdjustmentError
from adjust.planning.a_priori import APriori, a_priori_covariance
from adjust.planning.additions import Addition, additions
from adjust.planning.extension import extended
from adjust.planning.network import PlannedNetwork
from adjust.selection.determinability import INSEPARABLE, PRIOR_ONLY
from tasks.calibration.verdicts import (
    FlightVerdict,
    ParameterVerdict,
    flight_verdict,
    parameter_verdicts,
    pattern_reasons,
)
from tasks.errors import NotComputableError
from tasks.first_run import announce_compilation
from tasks.planning.request import PlanRequest
from tasks.quantities import is_calibrated, reported
from tasks.tables.covariance import Key, correlation_table


def expected_parameters(expected: APriori) -> pd.DataFrame:
    """The free parameters with the columns of parameters.parquet; nothing is estimated, so no change."""
    own_part = expected.own_part
    rows = []
    for k, (parameter, entity, own_unit) in enumerate(expected.names):
        unit, factor = reported(parameter, own_unit)
        sigma, prior = float(expected.sigma[k]), float(expected.prior_sigma[k])
        status = "not_significant"
        if own_part[k] < INSEPARABLE:
            status = "not_determinable"
        elif np.isfinite(prior) and sigma > PRIOR_ONLY * prior:
            status = "prior_only"
        rows.append(
            {
                "parameter": parameter,
                "entity": entity,
                "value": float(expected.value[k]) * factor,
                "change": 0.0,
                "sigma": sigma * factor,
                "sigma_prior": prior * factor,
                "sigma_over_prior": sigma / prior,
                "unit": unit,
                "t": 0.0,
                "status": status,
            }
        )
    return pd.DataFrame(rows)


def expected_correlations(expected: APriori) -> pd.DataFrame:
    """Every pair once, with the columns of correlations.parquet."""
    keys = [(parameter, entity) for parameter, entity, _ in expected.names]
    return correlation_table(keys, expected.correlation)


@dataclass(frozen=True, eq=False)
class Expectation:
    """What one network will give.

    Attributes
    ----------
    exposures, images, strips, points, rays, control : how many; without a rig every exposure is one image.
    pattern : directions and heights, recognised from the exposures.
    parameters, correlations : as parameters.parquet and correlations.parquet.
    verdicts : of every parameter.
    flight : of the flight.
    """

    exposures: int
    images: int
    strips: int
    points: int
    rays: int
    control: int
    pattern: FlightPattern
    parameters: pd.DataFrame
    correlations: pd.DataFrame
    verdicts: Mapping[Key, ParameterVerdict]
    flight: FlightVerdict

    @property
    def accepted(self) -> bool:
        """Whether it meets all limits."""
        return self.flight.verdict == "accepted"

    @property
    def quantities(self) -> tuple[ParameterVerdict, ...]:
        """The quantities of the calibration; biases and drifts of strips are not among them."""
        return tuple(item for item in self.verdicts.values() if is_calibrated(item.parameter))

    @property
    def worst(self) -> ParameterVerdict:
        """The quantity whose σ is the largest fraction of its limit."""
        return max(self.quantities, key=_part_of_limit)

    @property
    def worst_part(self) -> float:
        """Its σ over its limit."""
        return _part_of_limit(self.worst)


@dataclass(frozen=True, eq=False)
class Proposal:
    """An addition to the flight and what the flight would then give."""

    addition: Addition
    expectation: Expectation


@dataclass(frozen=True, eq=False)
class CalibrationPlan:
    """The result of a plan.

    Attributes
    ----------
    name : of the specification or project.
    request : what was asked.
    expectation : of the flight as it stands.
    proposals : additions that were computed, cheapest first; empty if none is needed or none was requested.
    """

    name: str
    request: PlanRequest
    expectation: Expectation
    proposals: tuple[Proposal, ...] = ()

    @property
    def cheapest(self) -> Proposal | None:
        """The cheapest addition with which the flight is accepted; None if there is none."""
        accepted = [proposal for proposal in self.proposals if proposal.expectation.accepted]
        return min(accepted, key=lambda item: item.addition.cost, default=None)


def plan_calibration(
    name: str, network: PlannedNetwork, request: PlanRequest, *, propose: bool = True
) -> CalibrationPlan:
    """Compute what a network will determine; if that is too little, the additions to it one after the other.

    They are tried in the order of their cost until one of them is accepted; those that leave directions or
    heights missing are not computed.

    Raises
    ------
    NotComputableError
        If the network does not determine its exposures, with what is open.
    """
    announce_compilation()
    here = _expectation(network, request)
    proposals: list[Proposal] = []
    if propose and not here.accepted:
        names = {item.parameter for item in here.quantities}
        if network.joined_heads:  # converging heads may determine their focal lengths at a single height
            names -= {"focal_length"}
        for addition in additions(network, request.limits.height_ratio):
            wider = extended(network, addition.strips, addition.control)
            lines_by_gnss = addition.groups and network.has_positions
            if lines_by_gnss and pattern_reasons(names, _pattern(wider), request.limits):
                continue  # directions or heights would still be missing, whatever the numbers are
            proposals.append(Proposal(addition, _expectation(wider, request)))
            if proposals[-1].expectation.accepted:
                break
    return CalibrationPlan(name, request, here, tuple(proposals))


def _expectation(network: PlannedNetwork, request: PlanRequest) -> Expectation:
    try:
        expected = a_priori_covariance(network, request.model(network))
    except AdjustmentError as error:
        raise NotComputableError(str(error)) from error
    pattern = _pattern(network)
    parameters, correlations = expected_parameters(expected), expected_correlations(expected)
    verdicts = parameter_verdicts(parameters, correlations, pattern, request.limits)
    return Expectation(
        len(network.exposures),
        len(network.event_of_image),
        len(network.strips),
        len(network.object_point),
        len(network.rays.image),
        len(network.control.point),
        pattern,
        parameters,
        correlations,
        verdicts,
        flight_verdict(
            parameters,
            correlations,
            verdicts,
            pattern,
            request.limits,
            by_gnss=network.has_positions,
            heads=network.joined_heads,
        ),
    )


def _pattern(network: PlannedNetwork) -> FlightPattern:
    return flight_pattern(network.heading, network.height_above_ground, network.exposures.strip)


def _part_of_limit(item: ParameterVerdict) -> float:
    return 0.0 if item.sigma is None or item.limit is None else item.sigma / item.limit
