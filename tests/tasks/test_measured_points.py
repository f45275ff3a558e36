"""Rows found by their numbers, and what the rows of a point in all images say of each other."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.deliveries.measured_points import BLOCK, RowsByNumber, counted, ranges
from tasks.deliveries.neighbouring_images import SharedPoints
from tasks.errors import InputError


@pytest.mark.parametrize("order", ["ascending", "any"])
def test_rows_are_found_by_their_number(order: str) -> None:
    number = np.random.default_rng(3).integers(-1, 900, 70_000).astype(np.int32)
    number = np.sort(number) if order == "ascending" else number
    by_number = RowsByNumber(number)
    for begin, end in ((0, 1), (0, 900), (417, 530), (899, 900)):
        wanted = np.flatnonzero((number >= begin) & (number < end))
        np.testing.assert_array_equal(by_number.rows(begin, end), wanted)
    assert len(by_number.rows(900, 950)) == 0


def test_ranges_take_every_number_once() -> None:
    count = np.random.default_rng(4).integers(0, BLOCK // 3, 60)
    count[[0, 17, 59]] = [0, 5 * BLOCK, 0]
    found = list(ranges(count))
    assert [begin for begin, _ in found] == [0, *(end for _, end in found[:-1])]
    assert found[-1][1] == len(count)
    assert len(found) > 5
    assert all(end == begin + 1 or count[begin:end].sum() <= 2 * BLOCK for begin, end in found)


def test_numbers_below_zero_are_not_counted() -> None:
    assert counted(np.array([2, -1, 2, 0], dtype=np.int32), 4).tolist() == [1, 0, 2, 0]


def test_only_neighbours_have_positions_that_differ_by_one() -> None:
    # Two strips, one with a gap, their images in no order, and images without strip.
    along = {"A": [0, 1, 2, 3, 9, 10, 11, 12], "B": [3, 2, 1, 0], None: [0, 1]}
    rows = [(strip, float(x)) for strip, places in along.items() for x in places]
    order = np.random.default_rng(5).permutation(len(rows))
    exposures = pd.DataFrame([rows[i] for i in order], columns=["strip", "x_m"]).assign(
        y_m=0.0, camera="CAM", flight=None, image=[f"I{i}" for i in range(len(rows))]
    )
    position = SharedPoints(exposures).position
    assert len(set(position)) == len(rows)
    for one in range(len(rows)):
        for other in range(len(rows)):
            (strip, x), (other_strip, other_x) = rows[order[one]], rows[order[other]]
            near = strip is not None and strip == other_strip and abs(x - other_x) == 1.0
            assert (abs(position[one] - position[other]) == 1) == near


def test_rows_in_any_order_give_the_same_table(delivery) -> None:
    random = np.random.default_rng(6)
    lines = [
        f"I{1 + image},P{point},{random.uniform(-24, 24):.3f},{random.uniform(-19, 19):.3f},r{point}-{image}"
        for image in range(3)
        for point in range(400)
    ]
    head = "image,point,x,y,remark\n"
    delivery.write(points=head + "\n".join(lines) + "\n")
    table = delivery.table(delivery.image_points(), "image_points")
    delivery.write(points=head + "\n".join(lines[i] for i in random.permutation(len(lines))) + "\n")
    pd.testing.assert_frame_equal(delivery.table(delivery.image_points(), "image_points"), table)
    number = table["image"].str[1:].astype(int) - 1
    assert (table["remark"] == "r" + table["point"].str[1:] + "-" + number.astype(str)).all()


def test_a_further_column_with_a_name_of_the_table_is_not_taken_for_it(delivery) -> None:
    delivery.write(points="image,point,x,y,input_file\nI1,P,1,1,a\nI2,P,2,2,b\n")
    table = delivery.table(delivery.image_points(), "image_points")
    assert table["input_file"].tolist() == ["points.csv", "points.csv"]


def test_more_rows_than_points_and_images_name_the_first_that_is_given_again(delivery) -> None:
    delivery.write(points="image,point,x,y\nI2,P,1,1\nI1,P,1,2\nI3,P,1,3\nI1,P,1,4\nI2,P,1,5\n")
    with pytest.raises(InputError, match=r"points.csv:5: .*given in line 3 \(1 more like this\)"):
        delivery.image_points()
