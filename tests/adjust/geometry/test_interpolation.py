"""Interpolation against motions that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.geometry.interpolation import Poses, between
from adjust.geometry.rotation import exp, log


def circle(time):
    """A turn of 100 m radius at 0.6 rad/s, with a constant rate about an axis of the body."""
    axis = np.array([0.1, -0.2, 0.55])
    angle = 0.6 * time
    place = 100.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    speed = 60.0 * np.column_stack([-np.sin(angle), np.cos(angle), np.full_like(angle, 0.1)])
    return Poses(place, speed, exp(time[:, None] * axis), np.tile(axis, (len(time), 1)))


def test_a_cubic_motion_is_found_again():
    random = np.random.default_rng(1)
    coefficients = random.normal(size=(4, 3))
    powers = np.arange(4)

    def at(time):
        place = (time[:, None] ** powers) @ coefficients
        speed = (powers[1:] * time[:, None] ** powers[:-1]) @ coefficients[1:]
        return Poses(place, speed)

    first, last, wanted = np.array([0.3, -1.0]), np.array([1.1, 0.7]), np.array([0.5, -0.9])
    found = between(at(first), at(last), last - first, wanted - first)
    np.testing.assert_allclose(found.position, at(wanted).position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.velocity, at(wanted).velocity, rtol=0, atol=1e-12)


def test_a_constant_rate_is_found_again_however_far_it_turns():
    first, last, wanted = np.array([0.0]), np.array([2.5]), np.array([1.7])
    found, true = between(circle(first), circle(last), last - first, wanted - first), circle(wanted)
    np.testing.assert_allclose(found.attitude, true.attitude, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.rate, true.rate, rtol=0, atol=1e-12)


def test_both_ends_are_met():
    first, last = circle(np.array([1.0])), circle(np.array([1.4]))
    for since, end in ((0.0, first), (0.4, last)):
        found = between(first, last, np.array([0.4]), np.array([since]))
        for name in ("position", "velocity", "attitude", "rate"):
            np.testing.assert_allclose(getattr(found, name), getattr(end, name), rtol=0, atol=1e-12)


def coning(time):
    """An attitude that turns about changing axes; its rates from its own derivative."""
    h = 1e-4

    def attitude(t):
        tilt = 0.1 * np.column_stack([np.sin(3 * t), np.cos(2 * t), np.sin(t)])
        return exp(tilt) @ exp(np.outer(0.5 * t, [0, 0, 1.0]))

    rate = log(np.swapaxes(attitude(time - h), 1, 2) @ attitude(time + h)) / (2 * h)
    return Poses(np.zeros((len(time), 3)), np.zeros((len(time), 3)), attitude(time), rate)


@pytest.mark.parametrize("motion", [circle, coning])
def test_the_error_is_of_the_fourth_order(motion):
    def error(interval):
        first, middle = np.array([0.2]), np.array([0.5 * interval])
        last, wanted = first + interval, first + middle
        found = between(motion(first), motion(last), np.array([interval]), middle)
        true = motion(wanted)
        if motion is circle:
            return np.linalg.norm(found.position - true.position)
        return np.linalg.norm(log(np.swapaxes(found.attitude, 1, 2) @ true.attitude))

    assert 13.0 < error(0.4) / error(0.2) < 19.0
    if motion is circle:
        # h⁴/384 of the fourth derivative, r ω⁴.
        assert error(0.2) == pytest.approx(0.2**4 / 384 * 100 * 0.6**4, rel=0.02)
