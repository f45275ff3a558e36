"""Platform calibration from the overlaps of four heads, and the datum it shares with adjusted flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from adjust.arrays import Floats
from adjust.calibration.platform import (
    calibrate_platform,
    covariance_with_mean_rotation,
    joint_test,
    with_mean_rotation,
)
from adjust.camera.virtual_image import PlatformHeads, composition_errors
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from tests.adjust.platform_scenes import dmc_heads, ties_of, virtual_grid

MILLIDEGREE = np.deg2rad(1e-3)


def off_by(given: PlatformHeads, seed: int) -> tuple[PlatformHeads, Floats]:
    """Heads that are 4 mdeg off, and their rotations against the given ones in the datum."""
    small = np.random.default_rng(seed).normal(0.0, 4.0 * MILLIDEGREE, (4, 3))
    true = given.turned(small)
    turn = with_mean_rotation(true.platform_from_head, given.platform_from_head)
    return true, rotation.log(turn @ np.swapaxes(given.platform_from_head, 1, 2))


@pytest.mark.parametrize("focal_lengths", [False, True])
def test_two_hundred_ties_find_the_heads(focal_lengths: bool) -> None:
    given = dmc_heads()
    true, expected = off_by(given, 3)
    found = calibrate_platform(given, ties_of(true, 202, 1000.0, 1.2e-6, 5), focal_lengths=focal_lengths)
    size, freedom = joint_test((found.change - expected).ravel(), found.covariance[:12, :12])
    assert freedom == 9
    assert size < scipy.stats.chi2.ppf(0.99, 9)
    assert np.all(found.sigma[:, :2] < 0.13 * MILLIDEGREE)
    assert np.all(found.sigma[:, 2] < 0.5 * MILLIDEGREE)
    assert found.redundancy == 404 - 9 - (3 if focal_lengths else 0)
    assert 0.9 < found.sigma0 < 1.1
    assert max(found.probability(head) for head in range(4)) < 1e-6
    near = replace(found, change=found.change * 1e-2)
    size = near.change[1] @ np.linalg.inv(found.covariance[3:6, 3:6]) @ near.change[1]
    assert near.probability(1) == pytest.approx(scipy.stats.chi2.sf(size, 3))
    np.testing.assert_allclose(found.change.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diagonal(found.correlation), 1.0)
    if focal_lengths:
        sigma = np.sqrt(np.diagonal(found.covariance))[12:]
        assert np.all(np.abs(found.focal_length_change / sigma) < 3.0)
    else:
        assert not found.focal_length_change.any()


def test_errors_are_as_large_as_their_standard_deviations_say() -> None:
    given = dmc_heads()
    sizes = []
    for seed in range(60):
        true, expected = off_by(given, seed)
        found = calibrate_platform(given, ties_of(true, 60, 1000.0, 1.2e-6, 1000 + seed))
        sizes.append(joint_test((found.change - expected).ravel(), found.covariance)[0])
    # The sum of χ² of nine has 540 ± 33.
    assert abs(sum(sizes) - 540.0) < 3.0 * np.sqrt(2.0 * 540.0)


def test_the_virtual_image_is_mended_by_the_calibration() -> None:
    given = dmc_heads()
    true, _ = off_by(given, 3)
    found = calibrate_platform(given, ties_of(true, 202, 1000.0, 1.2e-6, 5))
    turn = with_mean_rotation(true.platform_from_head, given.platform_from_head)
    true = PlatformHeads(turn, true.position, true.interior, true.half_format, true.focal_length)
    before, after = (
        composition_errors(true, heads, virtual_grid(), 1000.0, 1000.0)[0] for heads in (given, found.heads)
    )
    assert np.sqrt(np.mean(before**2)) > 5e-6
    assert np.sqrt(np.mean(after**2)) < 0.3e-6


def test_of_few_ties_sigma0_is_that_of_the_redundancy() -> None:
    """Twelve ties leave 15 of 24 degrees of freedom: its square is 1 in the mean, not 15/24."""
    given = dmc_heads()
    squares = []
    for seed in range(40):
        ties = ties_of(given, 202, 1000.0, 1.2e-6, seed)
        pairs = np.unique(ties.head, axis=0)
        rows = np.concatenate([np.flatnonzero((ties.head == pair).all(axis=1))[:3] for pair in pairs[:4]])
        found = calibrate_platform(given, ties.only(rows))
        squares.append(found.sigma0**2)
    assert found.redundancy == 2 * len(rows) - 9
    # χ² with so many degrees of freedom: 1 ± 4 √(2/r)/√40.
    assert abs(np.mean(squares) - 1.0) < 4.0 * np.sqrt(2.0 / found.redundancy / 40)


def test_one_point_in_common_joins_no_heads() -> None:
    given = dmc_heads()
    ties = ties_of(given, 202, 1000.0, 1.2e-6, 5)
    pairs = np.unique(ties.head, axis=0)
    rows = [int(np.flatnonzero((ties.head == pair).all(axis=1))[0]) for pair in pairs]
    assert 2 * len(rows) >= 8
    with pytest.raises(InconsistentBlockError, match="each needs at least two points"):
        calibrate_platform(given, ties.only(np.array(rows)))


def test_a_head_without_overlaps_is_refused() -> None:
    given = dmc_heads()
    ties = ties_of(given, 202, 1000.0, 1.2e-6, 5)
    with pytest.raises(InconsistentBlockError, match="each needs at least two points"):
        calibrate_platform(given, ties.only(np.flatnonzero((ties.head != 3).all(axis=1))))


def test_the_datum_takes_the_common_rotation_out_of_a_covariance() -> None:
    random = np.random.default_rng(2)
    root = random.normal(size=(12, 12))
    relative, common = root @ root.T, np.kron(np.ones((4, 4)), 100.0 * np.eye(3))
    found = covariance_with_mean_rotation(relative + common)
    np.testing.assert_allclose(found, covariance_with_mean_rotation(relative), atol=1e-9)
    np.testing.assert_allclose(found @ np.tile(np.eye(3), 4).T, 0.0, atol=1e-9)
    error = found @ random.normal(size=12)
    size, freedom = joint_test(error, found)
    assert (size, freedom) == (pytest.approx(error @ np.linalg.pinv(found, rcond=1e-10) @ error), 9)
