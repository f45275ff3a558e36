"""The smooth path through the exposures: it meets them, and its rates are derivatives."""

from __future__ import annotations

from functools import cache

import numpy as np

from adjust.geometry import rotation
from adjust.simulate.flown_path import FlownPath, flown_path
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockTruth, block_truth
from tests.adjust.simulate.specifications import on_the_earth, small_specification


@cache
def truth() -> BlockTruth:
    return block_truth(on_the_earth(small_specification(variation=FlightVariation(is_path=True))))


@cache
def path() -> FlownPath:
    return flown_path(truth().plan, truth().trajectory, 0)


def test_the_path_goes_through_every_exposure():
    flown = truth().trajectory
    np.testing.assert_allclose(path().position(flown.time), flown.projection_centre, rtol=0, atol=1e-8)
    np.testing.assert_allclose(path().local_from_body(flown.time), flown.local_from_body, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(path().velocity(flown.time), flown.velocity)
    np.testing.assert_array_equal(path().rate(flown.time), flown.rate)


def test_velocities_and_rates_are_the_derivatives_also_in_the_turns():
    h, time = 1e-4, np.linspace(path().span[0] + 1.0, path().span[1] - 1.0, 500)
    slope = (path().position(time + h) - path().position(time - h)) / (2 * h)
    np.testing.assert_allclose(path().velocity(time), slope, rtol=0, atol=1e-5)
    before, after = path().local_from_body(time - h), path().local_from_body(time + h)
    turn = rotation.log(np.swapaxes(before, 1, 2) @ after) / (2 * h)
    np.testing.assert_allclose(path().rate(time), turn, rtol=0, atol=1e-8)


def test_the_flight_turns_round_between_opposite_strips():
    heading = rotation.to_heading_pitch_roll(path().local_from_body(np.linspace(*path().span, 2_000)))[:, 0]
    # Steps of up to 0.4 s: the heading never jumps.
    assert np.abs(np.diff(np.unwrap(heading))).max() < np.deg2rad(5.0)
    assert np.ptp(np.unwrap(heading)) > np.deg2rad(150.0)
