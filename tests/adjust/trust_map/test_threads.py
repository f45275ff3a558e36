"""The trust map does not depend on the number of threads, nor on which cells are worked on together."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT
from adjust.trust_map import accuracy
from adjust.trust_map.accuracy import NewMeasurement, cell_accuracy, joint_solution
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import sight_of
from tests.adjust.scenes import Scene, two_strips
from tests.adjust.trust_map.grids import cells_over


@pytest.fixture(scope="module")
def scene() -> Scene:
    return two_strips(free={BORESIGHT: True}, noise_seed=3)


def trust_map(scene: Scene, threads: int) -> list[Floats]:
    """Everything that a trust map says of 30 rows of 40 cells."""
    options = AdjustmentOptions(threads=threads)
    result = adjust_block(scene.block, scene.observations, options)
    cells = cells_over(scene.truth.object_point, 40, 30)
    sight = sight_of(scene.block, result.state, cells.x_in_local)
    solution = joint_solution(result, sight)
    found = cell_accuracy(solution, cells, sight, NewMeasurement(3e-6, 1.3))
    errors = block_errors(solution, result, cells, sight, np.flatnonzero(sight.rays >= 3)[::50])
    return [
        found.sigma,
        found.sigma_of_pair,
        found.sigma_relative,
        found.external,
        found.uncontrolled.astype(np.float64),
        errors.of_orientation,
        errors.of_rays,
    ]


def test_one_two_and_four_threads_give_the_same_bytes(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    # Otherwise so few cells would be a single part, which one thread works on.
    monkeypatch.setattr(accuracy, "_RAYS_AT_ONCE", 400)
    one = trust_map(scene, 1)
    assert np.isfinite(one[0]).sum() > 500
    for threads in (2, 4):
        assert [values.tobytes() for values in trust_map(scene, threads)] == [v.tobytes() for v in one]


def test_parts_of_any_size_give_the_same_values(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = trust_map(scene, 1)
    monkeypatch.setattr(accuracy, "_RAYS_AT_ONCE", 200)
    for found, expected in zip(trust_map(scene, 1), whole, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-11)
