"""Image errors within the sub-areas of one camera of two: whether there are some, and what is enough."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from adjust.residual_grid.format_cells import FormatCells
from adjust.result import AdjustmentResult, ObservationStatus
from tasks.block.residual_grid import VariationWithin, variation_within

HALF = (0.05, 0.04)
CELLS = FormatCells.of(HALF, 4)
FINER = (FormatCells.of(HALF, 6), FormatCells.of(HALF, 12), FormatCells.of(HALF, 24))


def of_camera(camera: int, size: float, finer: tuple[FormatCells, ...] = FINER) -> VariationWithin | None:
    """Of residuals with unit noise; those of the second camera vary by the size within its sub-areas.

    Residuals that nothing controls, or that were rejected, vary also in the first one.
    """
    random, n = np.random.default_rng(3), 12_000
    image, xy = np.arange(n) % 80, random.uniform(-1.0, 1.0, (n, 2)) * HALF
    third = CELLS.finer(3).place[CELLS.finer(3).cell_of(xy)] % 3
    pattern = np.where(third == 1, -2.0, 1.0)
    redundancy, status = np.full((n, 2), 0.5), np.full((n, 2), int(ObservationStatus.USED))
    redundancy[::10], status[5::10] = 0.1, int(ObservationStatus.REJECTED)
    wrong = np.arange(n) % 5 == 0
    residual = random.normal(size=(n, 2)) + size * (image % 4 >= 2)[:, None] * pattern
    residual[wrong] += 9.0 * pattern[wrong]
    rays = SimpleNamespace(image=image, xy=xy)
    group = SimpleNamespace(residual=residual, redundancy=redundancy, status=status)
    block = SimpleNamespace(camera_of_image=np.arange(80) % 4 // 2)
    result = SimpleNamespace(observations=SimpleNamespace(image_points=rays), groups=(group,), block=block)
    return variation_within(camera, CELLS, finer, cast(AdjustmentResult, result), "cell")


def test_only_the_camera_with_errors_has_some_and_fewer_sub_areas_than_theirs_are_not_enough() -> None:
    first, second = of_camera(0, 1.0), of_camera(1, 1.0)
    assert first is not None
    assert (first.significant, first.enough) == (False, None)
    assert second is not None
    assert (second.significant, second.enough) == (True, 12)
    # RMS of (1, −2, 1), as it is within the sub-areas that are there.
    assert abs(second.found.rms - np.sqrt(2.0)) < 0.1
    none_enough = of_camera(1, 1.0, FINER[:1])
    assert none_enough is not None
    assert (none_enough.significant, none_enough.enough) == (True, None)


def test_errors_are_significant_where_chance_gives_them_in_one_of_a_thousand() -> None:
    found = [item for size in np.linspace(0.02, 0.1, 9) if (item := of_camera(1, size)) is not None]
    probability = np.array([item.found.probability for item in found])
    assert np.any((probability > 0.001) & (probability < 0.1))
    assert np.any((probability < 0.001) & (probability > 1e-8))
    assert [item.significant for item in found] == (probability < 0.001).tolist()


def test_a_camera_without_image_points_says_nothing() -> None:
    assert of_camera(2, 1.0) is None
