"""Work on several threads with results that do not depend on their number.

The object points are divided into lanes, a partition that follows from the block alone. Every lane sums
by itself, and the lanes are added up in their order, whoever has worked on them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise
from typing import TypeVar

import numpy as np

from adjust.arrays import Ints

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

# As many threads as can share the object points; every lane has its own copy of the sums.
_MOST_LANES = 8
# Below this number of image points a lane costs more than it saves.
_LEAST_RAYS = 5_000

Lane = tuple[int, int]


def lanes(point_start: Ints) -> tuple[Lane, ...]:
    """Ranges (first, last + 1) of object points with about the same number of image points.

    Parameters
    ----------
    point_start : (m + 1,) where the image points of each object point begin.
    """
    points, rays = len(point_start) - 1, int(point_start[-1])
    count = int(np.clip(rays // _LEAST_RAYS, 1, _MOST_LANES))
    limits = np.searchsorted(point_start, np.arange(1, count) * rays / count)
    edges = [0, *(int(limit) for limit in limits), points]
    return tuple(pairwise(edges))


def in_order(work: Callable[[_Item], _Result], items: Sequence[_Item], threads: int) -> Iterator[_Result]:
    """The results of work for every item, in the order of the items, each as soon as it is wanted.

    At most ``threads`` items are worked on, and no more than one result waits in addition, so that the
    memory of all results at once is never needed.
    """
    if threads <= 1 or len(items) <= 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(max_workers=threads) as pool:
        waiting: list[Future[_Result]] = []
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) > threads:
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()


def in_any_order(work: Callable[[_Item], None], items: Iterable[_Item], threads: int) -> None:
    """Call work for every item, on several threads where there are; each has its own result to write."""
    items = list(items)
    if threads <= 1 or len(items) <= 1:
        for item in items:
            work(item)
        return
    with ThreadPoolExecutor(max_workers=threads) as pool:
        for _ in pool.map(work, items):
            pass
