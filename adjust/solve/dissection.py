"""Nested dissection of the exposures: the order of Helmert blocking.

A block is cut in two across its longer axis; the images on the cut that see points with the other
half form a separator as small as possible, the halves are cut again, and so on. Parts do not know
each other, so they are eliminated independently; separators follow, from the small to the large
(Helmert 1880; George 1973).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import maximum_bipartite_matching

from adjust.arrays import Bools, Floats, Ints
from adjust.solve.covisibility import Covisibility

# Parts of at most this many images are eliminated as one dense matrix.
LARGEST_PART = 32


@dataclass(frozen=True, eq=False)
class Part:
    """A set of images eliminated together: a part of the block, or a separator.

    Attributes
    ----------
    own : (k,) images, ascending.
    boundary : (b,) images of later parts that its elimination connects, in the order of elimination.
    parent : index of the part that takes over what is left of this one; −1 for the last.
    height : 0 for a part without children, else one more than the highest child.
    """

    own: Ints
    boundary: Ints
    parent: int
    height: int


@dataclass(frozen=True, eq=False)
class Dissection:
    """All parts in the order of their elimination: children before parents, the last is the root.

    Attributes
    ----------
    parts : in that order.
    rank : (n,) place of every image in the order of elimination.
    """

    parts: tuple[Part, ...]
    rank: Ints


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Which images see common points with an image, itself apart; ascending.

    Attributes
    ----------
    start : (n + 1,) where those of each image begin.
    image : all of them, image by image.
    """

    start: Ints
    image: Ints

    @classmethod
    def of(cls, pattern: Covisibility) -> Neighbours:
        """Of every pair of a pattern, both ways."""
        off, n = pattern.column != pattern.row, pattern.events
        row, column = pattern.row[off], pattern.column[off]
        row, column = np.divmod(np.sort(np.concatenate([row * n + column, column * n + row])), n)
        return cls(np.searchsorted(row, np.arange(n + 1)).astype(np.int64), column)

    def pairs(self, images: Ints) -> tuple[Ints, Ints]:
        """Place among the images (k,) and neighbour, pair by pair, in the order of the images."""
        count = self.start[images + 1] - self.start[images]
        place = np.repeat(np.arange(len(images)), count)
        before = np.cumsum(count) - count
        return place, self.image[np.arange(len(place)) + (self.start[images] - before)[place]]


def dissect(pattern: Covisibility, position: Floats, largest_part: int = LARGEST_PART) -> Dissection:
    """Dissect the exposures of a block.

    Parameters
    ----------
    pattern : which images see common points.
    position : (n, 3) approximate projection centres, metres; they only steer the cuts.
    largest_part : number of images below which a part is not cut any more.
    """
    neighbours = Neighbours.of(pattern)
    owns: list[Ints] = []
    parents: list[int] = []
    _split(np.arange(pattern.events), neighbours, position[:, :2], largest_part, owns, parents)
    rank = np.empty(pattern.events, dtype=np.int64)
    rank[np.concatenate(owns)] = np.arange(pattern.events)
    return Dissection(_with_boundaries(owns, parents, neighbours, rank), rank)


def _split(
    images: Ints,
    neighbours: Neighbours,
    position: Floats,
    largest_part: int,
    owns: list[Ints],
    parents: list[int],
) -> int:
    """Append the parts of a set of images in post-order; the index of its top part."""
    halves = _bisect(images, neighbours, position) if len(images) > largest_part else None
    if halves is None:
        owns.append(images)
        parents.append(-1)
        return len(owns) - 1
    first, second, separator = halves
    children = [
        _split(half, neighbours, position, largest_part, owns, parents)
        for half in (first, second)
        if len(half)
    ]
    owns.append(separator)
    parents.append(-1)
    for child in children:
        parents[child] = len(owns) - 1
    return len(owns) - 1


def _bisect(images: Ints, neighbours: Neighbours, position: Floats) -> tuple[Ints, Ints, Ints] | None:
    """Two halves and the smaller of the separators across either principal axis; None if it saves nothing."""
    centred = position[images] - position[images].mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    best: tuple[Ints, Ints, Ints] | None = None
    for axis in axes.T[::-1]:
        order = np.argsort(centred @ axis, kind="stable")
        first = np.zeros(len(images), dtype=bool)
        first[order[: len(images) // 2]] = True
        separator = _separator(images, first, neighbours)
        if best is None or separator.sum() < len(best[2]):
            best = (images[first & ~separator], images[~first & ~separator], images[separator])
    assert best is not None
    return best if len(best[2]) < len(images) // 2 else None


def _separator(images: Ints, first: Bools, neighbours: Neighbours) -> Bools:
    """Smallest set of images (k,) that meets every pair across the cut.

    The pairs form a bipartite graph; its smallest vertex cover follows from a largest matching (König
    1931): everything that alternating paths from unmatched images of the first half do not reach on
    that side, and what they do reach on the other.
    """
    left, right = np.flatnonzero(first), np.flatnonzero(~first)
    place = np.full(len(neighbours.start), -1, dtype=np.int64)
    place[images[right]] = np.arange(len(right))
    row, image = neighbours.pairs(images[left])
    across = place[image] >= 0
    row, column = row[across], place[image[across]]
    crosses = np.zeros(len(left), dtype=bool)
    crosses[row] = True
    matched_left = _matching(row, column, len(left), len(right))
    matched_right = np.full(len(left), -1, dtype=np.int64)
    has = np.flatnonzero(matched_left >= 0)
    matched_right[matched_left[has]] = has
    reached_left = (matched_right < 0) & crosses
    reached_right = np.zeros(len(right), dtype=bool)
    fresh = reached_left.copy()
    while fresh.any():
        touched = np.zeros(len(right), dtype=bool)
        touched[column[fresh[row]]] = True
        touched &= ~reached_right
        reached_right |= touched
        partners = matched_left[touched]
        fresh = np.zeros(len(left), dtype=bool)
        fresh[partners[partners >= 0]] = True
        fresh &= ~reached_left
        reached_left |= fresh
    separator = np.zeros(len(images), dtype=bool)
    separator[left[~reached_left & crosses]] = True
    separator[right[reached_right]] = True
    return separator


def _matching(row: Ints, column: Ints, rows: int, columns: int) -> Ints:
    """Row (columns,) that a largest matching gives to each column, −1 for none; pairs (k,) by row."""
    start = np.searchsorted(row, np.arange(rows + 1)).astype(np.int32)
    graph = (np.ones(len(row), dtype=np.int8), column.astype(np.int32), start)
    pairs = scipy.sparse.csr_array(graph, shape=(rows, columns))
    return np.asarray(maximum_bipartite_matching(pairs, perm_type="row"), dtype=np.int64)


def _with_boundaries(
    owns: list[Ints], parents: list[int], neighbours: Neighbours, rank: Ints
) -> tuple[Part, ...]:
    """Parts with the images of later parts that they touch, directly or through their children."""
    parts: list[Part] = []
    collected: list[list[Ints]] = [[] for _ in owns]
    heights = [0] * len(owns)
    eliminated = 0
    image_of_rank = np.argsort(rank)
    for index, own in enumerate(owns):
        touched = np.concatenate([neighbours.pairs(own)[1], *collected[index]])
        eliminated += len(own)
        boundary = np.unique(rank[touched])
        boundary = boundary[boundary >= eliminated]
        parts.append(Part(own, image_of_rank[boundary], parents[index], heights[index]))
        if parents[index] >= 0:
            collected[parents[index]].append(parts[-1].boundary)
            heights[parents[index]] = max(heights[parents[index]], heights[index] + 1)
    return tuple(parts)
