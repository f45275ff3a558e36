"""Work on several threads whose results come in the order of what it was done for."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def in_turn(work: Callable[[_Item], _Result], items: Iterable[_Item], threads: int) -> Iterator[_Result]:
    """The results of `work` for every item, in the order of the items, which are made meanwhile.

    While an item is made or a result is used, up to `threads` items are worked on; so many may wait besides.
    An error in an item is raised where its result would come. A single item needs no thread.
    """
    rest = iter(items)
    held = deque(islice(rest, 2))
    if len(held) == 1:
        yield work(held.popleft())
        return
    with ThreadPoolExecutor(threads) as pool:
        begun: deque[Future[_Result]] = deque()
        for item in _all_of(held, rest):
            begun.append(pool.submit(work, item))
            del item
            if len(begun) > threads:
                yield begun.popleft().result()
        while begun:
            yield begun.popleft().result()


def _all_of(held: deque[_Item], rest: Iterator[_Item]) -> Iterator[_Item]:
    """All items; those that are held are let go."""
    while held:
        yield held.popleft()
    yield from rest
