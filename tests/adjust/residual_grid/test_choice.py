from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.geometry.earth import Ellipsoid, TopocentricFrame
from adjust.observations.image_point import ImagePoints
from adjust.residual_grid.choice import (
    CheckCoordinates,
    GridCandidate,
    GridOutcome,
    best_outcome,
    cells_of_cameras,
    try_candidates,
)
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.smoothing import Smoothing
from tests.adjust.calibration.camera_errors import NOTHING, SEAMS, TILES, high_block

CANDIDATES = tuple(GridCandidate(number) for number in (3, 9, 25, 45))


def test_cross_validation_finds_the_three_by_three_tiles_that_there_are() -> None:
    test = high_block(TILES)
    outcomes = try_candidates(
        test.block, test.result, CANDIDATES, GridRule(), seams=(SEAMS,), check=test.check
    )
    by_cells = {item.candidate.cells: item for item in outcomes if item.candidate}
    assert best_outcome(outcomes).candidate == CANDIDATES[0]
    gains = [by_cells[number].gain for number in (3, 9, 25, 45)]
    assert gains == sorted(gains, reverse=True)
    assert outcomes[0].candidate is None
    assert outcomes[0].gain == 0.0
    assert outcomes[0].sigma0 == test.result.test.sigma0
    # The check points agree with it, though they had no part in the choice.
    without, chosen = outcomes[0].check_rms, by_cells[3].check_rms
    assert without is not None
    assert chosen is not None
    np.testing.assert_allclose(without, test.check_rms(test.result.state), rtol=1e-9)
    assert chosen[2] < 0.5 * without[2]


def test_of_equal_gains_the_fewest_cells_are_the_best_and_an_unknown_gain_is_none() -> None:
    gains = ((3, np.nan), (25, 0.3), (9, 0.3), (45, 0.2))
    outcomes = [GridOutcome(GridCandidate(cells), 1, 1.0, gain, None) for cells, gain in gains]
    assert best_outcome(outcomes) is outcomes[2]


def test_differences_at_check_points_are_along_east_north_and_up_at_each() -> None:
    test = high_block(NOTHING)
    block = replace(test.block, frame=TopocentricFrame(Ellipsoid(6_378_137.0, 1.0 / 298.257), 0.8, 0.2))
    x = test.result.state.object_point[test.check.point]
    given = x - block.frame.local_from_enu(x) @ [1.0, -2.0, 30.0]
    check = CheckCoordinates(test.check.point, np.asarray(given))
    (without,) = try_candidates(block, test.result, (), check=check)
    assert without.check_rms is not None
    np.testing.assert_allclose(without.check_rms, [1.0, 2.0, 30.0], atol=1e-3)


def test_sigma0_alone_would_always_ask_for_more_cells() -> None:
    test = high_block(NOTHING)
    rule = GridRule(cross_validate=False, settled=0.0)
    outcomes = try_candidates(test.block, test.result, CANDIDATES, rule)
    # Nothing is gained, and the choice is to do nothing.
    assert best_outcome(outcomes).candidate is None
    assert all(item.check_rms is None for item in outcomes)
    assert all(not item.gain > 0.0 for item in outcomes)


def test_smoothing_is_chosen_where_cells_have_few_image_points() -> None:
    test = high_block(TILES)
    candidates = (GridCandidate(25), GridCandidate(25, Smoothing("counts")))
    outcomes = try_candidates(test.block, test.result, candidates)
    assert best_outcome(outcomes).candidate == candidates[1]


def test_a_camera_without_image_points_has_no_cells() -> None:
    test = high_block(NOTHING)
    rays = test.observations.image_points
    assert [own is None for own in cells_of_cameras(test.block, rays, 5)] == [False]
    none_left = ImagePoints(
        rays.image[:0], rays.point[:0], rays.camera_of_image, rays.xy[:0], rays.sigma[:0], rays.active[:0]
    )
    assert cells_of_cameras(test.block, none_left, 5) == (None,)
