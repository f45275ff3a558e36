"""Results come in the order of the items, errors where a result would come, and few items are made ahead."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from tasks.files.in_turn import in_turn


@pytest.mark.parametrize("threads", [1, 2])
def test_results_come_in_order_whichever_is_ready_first(threads: int) -> None:
    def work(number: int) -> int:
        time.sleep(0.001 * (5 - number % 5))
        return number**2

    assert list(in_turn(work, range(20), threads)) == [number**2 for number in range(20)]


def test_no_items_have_no_results() -> None:
    assert list(in_turn(abs, (), 2)) == []


@pytest.mark.parametrize("threads", [1, 2])
def test_few_items_are_made_before_their_results_are_taken(threads: int) -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for number in range(50):
            made.append(number)
            yield number

    for taken, _ in enumerate(in_turn(abs, items(), threads), start=1):
        assert len(made) <= taken + threads


def test_an_error_is_raised_behind_the_results_before_it() -> None:
    results = in_turn(lambda number: 1 // (3 - number), range(6), 2)
    assert [next(results) for _ in range(3)] == [0, 0, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_an_error_of_the_items_is_raised_and_no_thread_is_left() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("no more")

    before = threading.active_count()
    with pytest.raises(ValueError, match="no more"):
        list(in_turn(abs, items(), 2))
    assert threading.active_count() == before


def test_who_stops_early_leaves_no_thread() -> None:
    before = threading.active_count()
    results = in_turn(abs, range(100), 2)
    next(results)
    results.close()
    assert threading.active_count() == before
