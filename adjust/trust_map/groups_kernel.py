"""Groups of cells that are worked on side by side, and the images that any of them sees, compiled.

Many cells have the same images, but at the edges of images there are many sets of a few cells only. Small
sets that differ by few images share a group: a ray that a cell does not have counts as zero.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.trust_map.lane_kernel import LANES

# Sets of more cells have a group of their own.
_SMALL = 48
# Most cells of a group of several sets, and by how many images it may exceed the smallest of them.
_MOST_CELLS, _MOST_MORE = 128, 4
# Sets are sorted by their first images, so that similar ones follow each other: by two numbers of three each.
_HEAD, _BITS = 3, 21


@kernel
def largest_step(start):
    """The largest difference of numbers that follow each other; at least 1."""
    most = 1
    for j in range(start.shape[0] - 1):
        most = max(most, start[j + 1] - start[j])
    return most


@small_kernel
def same_images(first, last, other_first, other_last, image):
    """Whether the rays of two cells are in the same images."""
    same = other_last - other_first == last - first
    if same:
        for a in range(last - first):
            same = same and image[first + a] == image[other_first + a]
    return same


@kernel
def runs_of_images(start, image):
    """Runs of cells with the same images, at least two: first and last + 1 cell (n, 2); their hashes (n,)."""
    cells = start.shape[0] - 1
    runs, keys = np.empty((cells, 2), np.int64), np.empty(cells, np.int64)
    count = 0
    for j in range(cells):
        first, last = start[j], start[j + 1]
        if last - first < 2:
            continue
        if count and runs[count - 1, 1] == j and same_images(first, last, start[j - 1], first, image):
            runs[count - 1, 1] = j + 1
            continue
        key = 0
        for a in range(first, last):
            key = (key * 1_000_003 + image[a] + 1) % 2_147_483_647
        runs[count, 0], runs[count, 1], keys[count] = j, j + 1, key
        count += 1
    return runs[:count], keys[:count]


@kernel
def sets_of_runs(runs, start, image):
    """Sets of consecutive runs with the same images: their first runs (n + 1,) and what to sort them by.

    These are rows (3, n), the last one first: their next and their first images, and whether the set is
    large. Two sets may have the same images.
    """
    begun, keys = np.empty(runs.shape[0] + 1, np.int64), np.zeros((3, runs.shape[0]), np.int64)
    count, cells = 0, 0
    for r in range(runs.shape[0]):
        first, last = start[runs[r, 0]], start[runs[r, 0] + 1]
        before = start[runs[r - 1, 0]], start[runs[r - 1, 0] + 1]
        if r == 0 or not same_images(first, last, before[0], before[1], image):
            begun[count], cells = r, 0
            for a in range(2 * _HEAD):
                row, number = 1 - a // _HEAD, image[first + a] if first + a < last else 0
                keys[row, count] = (keys[row, count] << _BITS) + number
            count += 1
        cells += runs[r, 1] - runs[r, 0]
        keys[2, count - 1] = 1 if cells > _SMALL else 0
    begun[count] = runs.shape[0]
    return begun[: count + 1], keys[:, :count]


@small_kernel
def union(one, first, last, image, begin, end, both):
    """Fill both with the images of two ascending lists; returns how many there are."""
    count = 0
    while first < last or begin < end:
        if begin == end or (first < last and one[first] < image[begin]):
            both[count] = one[first]
            first += 1
        else:
            if first < last and one[first] == image[begin]:
                first += 1
            both[count] = image[begin]
            begin += 1
        count += 1
    return count


@kernel
def groups_of_sets(runs, begun, large, order, start, image):
    """Cells, where those of each group begin, the images of the groups, and where they begin.

    Sets, in this order, join the group of the one before where it stays small enough.
    """
    rays, most = 0, 0
    for s in range(order.shape[0]):
        j = runs[begun[s], 0]
        rays, most = rays + start[j + 1] - start[j], max(most, start[j + 1] - start[j])
    total = 0
    for r in range(runs.shape[0]):
        total += runs[r, 1] - runs[r, 0]
    cells, seen, both = (
        np.empty(total, np.int64),
        np.empty(rays, np.int64),
        np.empty(2 * most + _MOST_MORE, np.int64),
    )
    cell_start, seen_start = np.zeros(order.shape[0] + 1, np.int64), np.zeros(order.shape[0] + 1, np.int64)
    # Not literals, for which callees would be compiled once more.
    groups, filled, known, least = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    for s in order:
        j, own = runs[begun[s], 0], 0
        for r in range(begun[s], begun[s + 1]):
            own += runs[r, 1] - runs[r, 0]
        k = start[j + 1] - start[j]
        joins = False
        if groups > 0 and not large[s] and filled - cell_start[groups - 1] + own <= _MOST_CELLS:
            count = union(seen, seen_start[groups - 1], known, image, start[j], start[j + 1], both)
            joins = count <= min(least, k) + _MOST_MORE
        if joins:
            least = min(least, k)
            known = seen_start[groups - 1] + count
            seen[seen_start[groups - 1] : known] = both[:count]
        else:
            cell_start[groups], seen_start[groups], least = filled, known, k
            seen[known : known + k] = image[start[j] : start[j + 1]]
            known += k
            groups += 1
        for r in range(begun[s], begun[s + 1]):
            for c in range(runs[r, 0], runs[r, 1]):
                cells[filled] = c
                filled += 1
    cell_start[groups], seen_start[groups] = filled, known
    return cells, cell_start[: groups + 1], seen[:known], seen_start[: groups + 1]


@kernel
def common_images(start, image, one, other):
    """Images that both of two cells see, pair after pair: where they begin (n + 1,), and the images."""
    begun, common, count = np.zeros(one.shape[0] + 1, np.int64), np.empty(0, np.int64), 0
    for fill in range(2):
        count = 0
        for n in range(one.shape[0]):
            b, last = start[other[n]], start[other[n] + 1]
            for a in range(start[one[n]], start[one[n] + 1]):
                while b < last and image[b] < image[a]:
                    b += 1
                if b < last and image[b] == image[a]:
                    if fill == 1:
                        common[count] = image[a]
                    count += 1
            begun[n + 1] = count
        if fill == 0:
            common = np.empty(count, np.int64)
    return begun, common


@kernel
def rays_of_group(k, m, cell, first, seen, start, image, at, ray, there):
    """Rays of m cells in the k images of their group, seen[first] and those behind it.

    Fills ray with their places, and there with 1, or 0 where a cell does not see an image. Returns whether
    all cells see k images. at (LANES,) is scratch.
    """
    whole = True
    for n in range(m):
        at[n] = start[cell[n]]
        whole = whole and start[cell[n] + 1] - at[n] == k
    for a in range(k):
        wanted = seen[first + a]
        for n in range(m):
            b, last = at[n], start[cell[n] + 1]
            while b < last and image[b] < wanted:
                b += 1
            found = b < last and image[b] == wanted
            at[n] = b + 1 if found else b
            ray[a * LANES + n] = b if found else start[cell[n]]
            there[a * LANES + n] = 1.0 if found else 0.0
    return whole


@small_kernel
def clear_where_not(k, m, there, rows, values):
    """Zeros in so many rows of each ray of m cells that is not there."""
    for a in range(k):
        seeing = 0.0
        for n in range(m):
            seeing += there[np.uintp(a * LANES + n)]
        for j in range(rows if seeing < m else 0):
            own = (rows * a + j) * LANES
            for n in range(m):
                value = values[np.uintp(own + n)]
                values[np.uintp(own + n)] = value if there[np.uintp(a * LANES + n)] != 0.0 else 0.0


@kernel
def leave_out(k, m, there, width, errors, exposures, points, systems, knowns):
    """Zeros in all derivatives of the rays of m cells that are not there."""
    clear_where_not(k, m, there, np.int64(12), exposures)
    clear_where_not(k, m, there, np.int64(6), points)
    clear_where_not(k, m, there, 2 * width, systems)
    clear_where_not(k, m, there, 2 * errors, knowns)
