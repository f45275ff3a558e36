"""What a shift of each flight and a lever arm of each mounting leave of the offsets of strips."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration import mountings
from adjust.calibration.mountings import TestedAxes, stable_offsets
from adjust.calibration.strip_means import StripMeans

COUNT = 16
FLIGHT = np.repeat([0, 1], COUNT // 2)
PART = np.tile([0, 0, 1, 1], COUNT // 4)
HEADING = np.deg2rad(10.0 + 90.0 * (np.arange(COUNT) % 4) + 7.0 * np.arange(COUNT))
SHIFTS = np.array([[0.3, -0.2], [-0.1, 0.4]])
ARMS = np.array([[0.15, 0.05], [-0.25, 0.1]])


def turns(heading: Floats) -> Floats:
    """(k, 2, 2) east and north from forward and right."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return np.stack([np.stack([sine, cosine], axis=1), np.stack([cosine, -sine], axis=1)], axis=1)


def strips_with(offset: Floats, flight: Ints = FLIGHT, heading: Floats = HEADING) -> StripMeans:
    """Strips with offsets (k, 2) east and north; 0.5 m down, 0.7 m up."""
    k = len(offset)
    mean, nothing = np.zeros((k, 9)), np.full((k, 9), np.nan)
    mean[:, 3:5] = np.einsum("kji,kj->ki", turns(heading), offset)
    mean[:, 5], mean[:, 6:8], mean[:, 8] = 0.5, offset, 0.7
    number, one = np.arange(k), np.zeros(k, dtype=np.int64)
    return StripMeans(
        number, flight, number.astype(float), one + 20, mean, nothing, nothing, nothing, nothing, heading,
        np.full(k, 1000.0), one, one,
    )  # fmt: skip


def offsets(noise: Floats) -> Floats:
    return np.asarray(SHIFTS[FLIGHT] + np.einsum("kij,kj->ki", turns(HEADING), ARMS[PART]) + noise)


@pytest.mark.parametrize(("axes", "vertical"), [("body", 0.5), ("map", 0.7)])
def test_a_strip_that_says_nothing_of_them_shows_all_of_its_own_offset(
    axes: TestedAxes, vertical: float
) -> None:
    own = np.zeros((COUNT, 2))
    own[5] = [0.6, -0.3]
    left = stable_offsets(strips_with(offsets(own)), PART, np.arange(COUNT) != 5, axes)
    expected = np.einsum("kji,kj->ki", turns(HEADING), own) if axes == "body" else own
    np.testing.assert_allclose(left[:, :2], expected, atol=1e-8)
    np.testing.assert_allclose(left[:, 2], vertical)


def design() -> Floats:
    """(k, 2, 8) of the shifts and the lever arms."""
    of_flights = (FLIGHT[:, None] == [0, 1])[:, None, :, None] * np.eye(2)[None, :, None, :]
    of_parts = (PART[:, None] == [0, 1])[:, None, :, None] * turns(HEADING)[:, :, None, :]
    return np.concatenate([of_flights, of_parts], axis=2).reshape(COUNT, 2, 8)


def unbalanced(left: Floats, kept: Bools) -> float:
    """Largest of Σ w Aᵀ r, zero for the fit with Huber's weights w of the distances |r| of the kept ones."""
    distance = np.linalg.norm(left, axis=1)
    weight = kept * np.minimum(1.0, 1.5 * np.median(distance[kept]) / distance)
    return float(np.abs(np.einsum("k,kij,ki->j", weight, design(), left)).max())


def test_the_strips_that_are_kept_are_fitted_with_the_weights_of_huber() -> None:
    noise = np.random.default_rng(4).normal(0.0, 0.02, (COUNT, 2))
    noise[3] += 1.0
    noise[[8, 9, 10]] += 2.0
    kept = ~np.isin(np.arange(COUNT), [8, 9, 10])
    left = stable_offsets(strips_with(offsets(noise)), PART, kept, "map")[:, :2]
    assert unbalanced(left, kept) < 1e-7
    # A gross error among them hardly moves the others.
    assert np.linalg.norm(left[kept & (np.arange(COUNT) != 3)], axis=1).max() < 0.15


def test_of_fewer_strips_than_unknowns_the_mean_of_the_kept_ones_is_taken_off() -> None:
    offset = np.array([[0.3, 0.1], [0.5, -0.1], [5.0, 5.0]])
    kept = np.array([True, True, False])
    strips = strips_with(offset, np.array([0, 0, 1]), np.deg2rad([0.0, 180.0, 90.0]))
    left = stable_offsets(strips, np.array([0, 0, 0]), kept, "map")
    np.testing.assert_allclose(left[:, :2], offset - [0.4, 0.0], atol=1e-12)


@pytest.mark.parametrize("axes", ["body", "map"])
def test_tested_are_the_axes_in_which_most_strips_agree_whatever_the_others_say(axes: str) -> None:
    offset = np.full((COUNT, 2), 0.3)
    if axes == "body":
        offset = np.einsum("kij,kj->ki", turns(HEADING), offset)
    offset[:6] += np.random.default_rng(2).normal(0.0, 5.0, (6, 2))
    assert mountings.tested_axes(strips_with(offset)) == axes
