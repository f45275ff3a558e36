"""Which pairs of events see a common object point, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel


@kernel
def upper_pattern(event_start, point_of_ray, point_start, event_of_ray, events):
    """Rows of the upper block triangle, diagonal included: row_start (events + 1), column (blocks).

    event_start / point_of_ray list the points of every event, point_start / event_of_ray the events
    of every point. The diagonal comes first in every row, the others as they are met.
    """
    mark = np.full(events, -1, np.int64)
    row_start = np.zeros(events + 1, np.int64)
    for fill in range(2):
        column = np.empty(row_start[events] if fill == 1 else 0, np.int64)
        total = 0
        for i in range(events):
            stamp = i + fill * events
            mark[i] = stamp
            if fill == 1:
                column[total] = i
            total += 1
            for k in range(event_start[i], event_start[i + 1]):
                j = point_of_ray[k]
                for q in range(point_start[j], point_start[j + 1]):
                    other = event_of_ray[q]
                    if other > i and mark[other] != stamp:
                        mark[other] = stamp
                        if fill == 1:
                            column[total] = other
                        total += 1
            if fill == 0:
                row_start[i + 1] = total
    return row_start, column


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
