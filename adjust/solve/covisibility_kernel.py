"""Which pairs of events see a common object point, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel


@small_kernel
def rays_by_event(event, events):
    """Where the rays of every event begin (events + 1,), and the rays (n,) event by event, ascending."""
    start = np.zeros(events + 1, np.int64)
    for i in range(event.shape[0]):
        start[event[i] + 1] += 1
    for e in range(events):
        start[e + 1] += start[e]
    place = start.copy()
    rays = np.empty(event.shape[0], np.int64)
    for i in range(event.shape[0]):
        rays[place[event[i]]] = i
        place[event[i]] += 1
    return start, rays


@kernel
def upper_pattern(event, point, point_start, events):
    """Rows of the upper block triangle, diagonal included: row_start (events + 1), column (blocks).

    event (n,) and point (n,) belong to the rays, sorted by point; those of every point begin at point_start.
    The diagonal comes first in every row, the others as they are met.
    """
    event_start, rays = rays_by_event(event, events)
    mark = np.full(events, -1, np.int64)
    row_start = np.zeros(events + 1, np.int64)
    column = np.empty(16 * events, np.int64)
    total = 0
    for i in range(events):
        if total + events > column.shape[0]:
            longer = np.empty(2 * column.shape[0], np.int64)
            longer[:total] = column[:total]
            column = longer
        mark[i] = i
        column[total] = i
        total += 1
        for k in range(event_start[i], event_start[i + 1]):
            j = point[rays[k]]
            for q in range(point_start[j], point_start[j + 1]):
                other = event[q]
                if other > i and mark[other] != i:
                    mark[other] = i
                    column[total] = other
                    total += 1
        row_start[i + 1] = total
    return row_start, column[:total].copy()


@small_kernel
def find_block(row_start, column, i, j):
    """Position of block (i, j), i ≤ j, in the pattern; −1 if it is not there."""
    low = row_start[i]
    high = row_start[i + 1] - 1
    while low <= high:
        middle = (low + high) // 2
        if column[middle] == j:
            return middle
        if column[middle] < j:
            low = middle + 1
        else:
            high = middle - 1
    return -1
