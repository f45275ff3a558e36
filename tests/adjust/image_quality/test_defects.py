"""Planted defects of a sensor: all are found, none is invented, and each is what it was planted as."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.image_quality.defects import Defects, defects, deviating

ROWS, COLUMNS, LEVEL = 300, 400, 2000.0
#: Rows and columns of pixels alone: inside, at the borders, in the corners.
ALONE = [(50, 60), (120, 333), (0, 200), (299, 17), (80, 0), (200, 399), (0, 0), (299, 399)]
CLUSTER = [(150, 250), (150, 251), (151, 252)]
BLOCK = [(r, c) for r in (220, 221, 222) for c in (100, 101, 102)]


def flat(seed: int = 1) -> Floats:
    """A flat image with noise of 2 % and a fall-off of 20 % to the corners."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:ROWS, :COLUMNS]
    radius = np.hypot(row - ROWS / 2, column - COLUMNS / 2) / np.hypot(ROWS / 2, COLUMNS / 2)
    return LEVEL * (1.0 - 0.2 * radius**2) * (1.0 + rng.normal(0.0, 0.02, row.shape))


def found_in(image: Floats) -> Defects:
    return defects(deviating(image, 0.3, relative=True))


@pytest.mark.parametrize("part", [0.0, 0.6, 1.4, 2.0])
def test_all_planted_pixels_and_clusters_are_found_and_no_others(part: float) -> None:
    image = flat()
    for place in ALONE + CLUSTER + BLOCK:
        image[place] *= part
    found = found_in(image)
    assert sorted(map(tuple, found.pixels.tolist())) == sorted(ALONE + CLUSTER + BLOCK)
    assert (found.clusters, found.single, found.double) == (2, 0, 0)
    alone = {tuple(place) for place in found.pixels[found.cluster == 0].tolist()}
    assert alone == set(ALONE)


@pytest.mark.parametrize("part", [0.65, 1.35])
def test_columns_are_single_or_double_wherever_they_are(part: float) -> None:
    image = flat()
    for columns in ([0], [30], [50, 51], [398, 399]):
        image[20:280, columns] *= part
    image[100:140, 200] *= part
    found = found_in(image)
    assert found.columns.tolist() == [
        [20, 0, 279, 0], [20, 30, 279, 30], [20, 50, 279, 51], [100, 200, 139, 200], [20, 398, 279, 399],
    ]  # fmt: skip
    assert (found.single, found.double, len(found.pixels)) == (3, 2, 0)
    assert found.smallest_distance == 20


def test_twelve_pixels_make_no_column_and_thirteen_do() -> None:
    image = flat()
    image[10:130:10, 100] = 0.0
    image[10:140:10, 300] = 0.0
    found = found_in(image)
    assert found.columns.tolist() == [[10, 300, 130, 300]]
    assert len(found.pixels) == 12


def test_a_deviation_below_the_limit_is_none() -> None:
    image = np.full((40, 40), 1000.0)
    image[20, 20], image[30, 30], image[10, 10] = 1299.0, 701.0, 1301.0
    assert deviating(image, 0.3, relative=True).tolist() == [[10, 10]]


def test_dark_images_are_judged_by_grey_values() -> None:
    rng = np.random.default_rng(2)
    image = 64.0 + rng.normal(0.0, 4.0, (ROWS, COLUMNS))
    image[5, 7] += 60.0
    image[100:200, 33] += 60.0
    found = defects(deviating(image, 41.0, relative=False))
    assert found.pixels.tolist() == [[5, 7]]
    assert found.columns.tolist() == [[100, 33, 199, 33]]


def test_a_sensor_without_defects_has_none() -> None:
    found = found_in(flat(3))
    assert (len(found.pixels), len(found.columns), found.clusters, found.smallest_distance) == (0, 0, 0, None)


def test_columns_side_by_side_are_one_defect_and_the_next_one_is_counted_from_its_end() -> None:
    rows = np.arange(13)
    places = [(row, column) for column in (10, 11, 20, 22) for row in rows]
    apart = defects(np.array(places[:39]))
    assert apart.columns[:, [1, 3]].tolist() == [[10, 11], [20, 20]]
    assert (apart.double, apart.single, apart.smallest_distance) == (1, 1, 9)
    assert defects(np.array(places)).columns[:, [1, 3]].tolist() == [[10, 11], [20, 20], [22, 22]]


def test_pixels_that_touch_are_a_cluster_and_others_are_not() -> None:
    found = defects(np.array([[5, 5], [5, 7], [8, 8], [9, 9], [20, 20], [22, 20]]))
    assert found.cluster.tolist() == [0, 0, 1, 1, 0, 0]
