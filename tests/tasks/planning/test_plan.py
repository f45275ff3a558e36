"""Verdicts of a plan are those that the calibration of the same flight gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.planning.network import PlannedNetwork
from adjust.planning.simulated_network import simulated_network
from adjust.simulate.object_points import PointSpecification
from tasks.planning.plan import plan_calibration
from tasks.planning.request import PlanRequest
from tasks.settings.calibration import AcceptanceLimits
from tests.adjust.simulate.specifications import small_specification

LIMITS = AcceptanceLimits(focal_length_um=1e6, principal_point_um=1e6)
REQUEST = PlanRequest(("focal_length", "principal_point"), strip_bias_m=0.0, limits=LIMITS)


@pytest.fixture(scope="module")
def network() -> PlannedNetwork:
    """One height, with GNSS positions and control."""
    return simulated_network(small_specification(points=PointSpecification(count=300)))


def test_control_alone_needs_neither_directions_nor_heights(network: PlannedNetwork) -> None:
    """As `aerocal calibrate` judges a block without observed GNSS positions."""
    exposures = network.exposures
    without = replace(exposures, position_sigma=np.full_like(exposures.position_sigma, np.nan))
    of_control = plan_calibration("", replace(network, exposures=without), REQUEST, propose=False)
    assert of_control.expectation.flight.reasons == ()
    by_gnss = plan_calibration("", network, REQUEST, propose=False)
    assert any("from GNSS positions" in reason for reason in by_gnss.expectation.flight.reasons)
