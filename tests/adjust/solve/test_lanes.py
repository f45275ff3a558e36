"""The order of results and sums, whoever works on them."""

from __future__ import annotations

import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.solve.lanes import in_any_order, in_order, lanes


@given(st.lists(st.integers(0, 4000), min_size=1, max_size=200))
def test_lanes_are_a_partition_of_the_points(rays_per_point: list[int]) -> None:
    start = np.concatenate([[0], np.cumsum(rays_per_point)]).astype(np.int64)
    parts = lanes(start)
    assert parts[0][0] == 0
    assert parts[-1][1] == len(rays_per_point)
    assert all(last == first for (_, last), (first, _) in pairwise(parts))
    assert all(first <= last for first, last in parts)
    if len(parts) > 1:
        even = start[-1] / len(parts)
        assert all(start[last] - start[first] <= even + 4000 for first, last in parts)


def test_a_small_block_is_one_lane_and_a_large_one_is_several() -> None:
    assert lanes(np.arange(0, 3001, 3)) == ((0, 1000),)
    assert len(lanes(np.arange(0, 600_001, 3))) == 8


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_results_come_in_the_order_of_the_items(threads: int) -> None:
    def work(item: int) -> int:
        time.sleep(0.002 * (item % 3))
        return item * item

    assert list(in_order(work, range(20), threads)) == [item * item for item in range(20)]


def test_results_do_not_pile_up() -> None:
    """Lanes hold copies of the sums: with two threads at most three of them are there at once."""
    alive, most = 0, 0
    lock = threading.Lock()

    def work(item: int) -> int:
        nonlocal alive, most
        with lock:
            alive += 1
            most = max(most, alive)
        return item

    for _ in in_order(work, range(30), threads=2):
        time.sleep(0.002)
        with lock:
            alive -= 1
    assert most <= 3


@pytest.mark.parametrize("threads", [1, 3])
def test_an_error_in_a_lane_reaches_the_caller(threads: int) -> None:
    def work(item: int) -> None:
        if item == 5:
            raise ArithmeticError("item 5")

    with pytest.raises(ArithmeticError, match="item 5"):
        list(in_order(work, range(10), threads))
    with pytest.raises(ArithmeticError, match="item 5"):
        in_any_order(work, range(10), threads)


def test_everything_is_worked_on_once() -> None:
    done: list[int] = []
    in_any_order(done.append, range(100), threads=4)
    assert sorted(done) == list(range(100))
