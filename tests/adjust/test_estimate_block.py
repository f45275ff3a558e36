"""Adjusted values without the statistics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.errors import DatumDefectError, DivergenceError, InconsistentBlockError
from adjust.options import AdjustmentOptions
from adjust.solve.gauss_newton import Iteration
from tests.adjust.scenes import ALL_FREE, two_strips


def test_the_values_are_those_of_the_complete_adjustment() -> None:
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=5, start_seed=6)
    steps: list[Iteration] = []
    estimate = estimate_block(scene.block, scene.observations, progress=steps.append)
    complete = adjust_block(scene.block, scene.observations)
    of_exposures = np.sqrt(np.diagonal(complete.cofactor.reduced.of_exposures, axis1=1, axis2=2))
    of_points = np.sqrt(np.diagonal(complete.cofactor.of_points, axis1=1, axis2=2))
    for found, expected, sigma in (
        (estimate.state.projection_centre, complete.state.projection_centre, of_exposures[:, :3]),
        (estimate.state.local_from_camera, complete.state.local_from_camera, of_exposures[:, 3:].min()),
        (estimate.state.object_point, complete.state.object_point, of_points),
    ):
        assert np.nanmax(np.abs(found - expected) / sigma) < 1e-6
    assert estimate.iterations == complete.iterations[0] == tuple(steps)
    assert estimate.weighted_squares == pytest.approx(complete.test.weighted_squares, abs=1e-6)


def test_what_cannot_be_determined_is_refused() -> None:
    scene = two_strips(control=(), gnss=False, ins=False, noise_seed=5)
    with pytest.raises(DatumDefectError):
        estimate_block(scene.block, scene.observations)


def test_the_number_of_iterations_is_limited() -> None:
    scene = two_strips(noise_seed=5, start_seed=6)
    with pytest.raises(DivergenceError):
        estimate_block(scene.block, scene.observations, AdjustmentOptions(most_iterations=1))


def test_a_start_behind_the_camera_is_refused() -> None:
    scene = two_strips(noise_seed=5)
    raised = scene.block.object_point + np.array([0.0, 0.0, 1e5])
    with pytest.raises(InconsistentBlockError, match="behind a camera"):
        estimate_block(replace(scene.block, object_point=raised), scene.observations)
