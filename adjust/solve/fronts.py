"""The fronts of Helmert blocking: which exposures and which blocks of a pattern stand where.

Symbolic analysis only; `helmert_blocking` does the arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.solve.covisibility import Covisibility
from adjust.solve.dissection import LARGEST_PART, Dissection, dissect

# A thread takes subtrees with at most this part of the operations at a time.
_PORTION = 1.0 / 12.0


@dataclass(frozen=True, eq=False)
class HeldBlocks:
    """Blocks of a pattern that a front holds.

    Attributes
    ----------
    blocks : (k,) which ones.
    lower, upper : (k,) their row and column in the front, lower ≥ upper, in exposures.
    transposed : (k,) whether the pattern holds the transposed block.
    """

    blocks: Ints
    lower: Ints
    upper: Ints
    transposed: Bools


@dataclass(frozen=True, eq=False)
class Front:
    """Where everything of one part is in its front, in units of exposures.

    Attributes
    ----------
    own, rest : numbers of own and of boundary exposures.
    images : (own + rest,) the exposures in the order of the front.
    parent : index of the parent's front, −1 for the root.
    height : see :class:`~adjust.solve.dissection.Part`.
    in_parent : (rest,) place of the boundary exposures in the parent's front.
    held : the pattern's blocks that are assembled here.
    """

    own: int
    rest: int
    images: Ints
    parent: int
    height: int
    in_parent: Ints
    held: HeldBlocks


@dataclass(frozen=True, eq=False)
class HelmertBlocking:
    """Symbolic analysis of a block: made once, used in every iteration.

    Attributes
    ----------
    pattern : which exposure blocks there are.
    fronts : in the order of elimination.
    """

    pattern: Covisibility
    fronts: tuple[Front, ...]
    _rows: dict[int, list[tuple[slice, Ints]]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, pattern: Covisibility, position: Floats, largest_part: int = LARGEST_PART) -> HelmertBlocking:
        """Analyse a pattern; positions (n, 3) and the largest part only steer the cuts."""
        return cls(pattern, _fronts(pattern, dissect(pattern, position, largest_part)))

    @cached_property
    def steps(self) -> tuple[tuple[range, ...], ...]:
        """Ranges of fronts, step by step; those of one step can be worked on at once.

        First whole subtrees, none of them with more than a small part of the operations, the largest first:
        one thread goes through each of them depth first, with little memory. Above them front by front,
        those of one height at once.
        """
        operations, first = self._operations, np.arange(len(self.fronts))
        for index, front in enumerate(self.fronts):
            if front.parent >= 0:
                operations[front.parent] += operations[index]
                first[front.parent] = min(first[front.parent], first[index])
        small = operations <= _PORTION * operations[-1]
        subtrees, above = list[int](), dict[int, list[range]]()
        for index, front in enumerate(self.fronts):
            if not small[index]:
                above.setdefault(front.height, []).append(range(index, index + 1))
            elif front.parent < 0 or not small[front.parent]:
                subtrees.append(index)
        subtrees.sort(key=lambda index: -operations[index])
        portions = tuple(range(first[index], index + 1) for index in subtrees)
        return (portions, *(tuple(above[height]) for height in sorted(above)))

    @property
    def _operations(self) -> Floats:
        """How many operations the elimination of each front takes, but for a factor."""
        p, q = (np.array([float(getattr(front, name)) for front in self.fronts]) for name in ("own", "rest"))
        return np.asarray(p * (p * p / 3.0 + p * q + q * q))

    def placed(self, pattern: Covisibility) -> tuple[list[HeldBlocks], Ints]:
        """Where the blocks of another pattern are in every front, and the blocks (k,) that no front holds."""
        if pattern is self.pattern:
            return [front.held for front in self.fronts], np.zeros(0, dtype=np.int64)
        images = [front.images for front in self.fronts]
        found, missing = list[HeldBlocks](), [np.zeros(0, dtype=np.int64)]
        for held in _held(pattern, images, [front.own for front in self.fronts]):
            there = held.upper >= 0
            missing.append(held.blocks[~there])
            found.append(
                HeldBlocks(held.blocks[there], held.lower[there], held.upper[there], held.transposed[there])
            )
        return found, np.sort(np.concatenate(missing))

    @cached_property
    def order(self) -> Ints:
        """(n,) the exposures in the order of elimination."""
        return np.concatenate([front.images[: front.own] for front in self.fronts])

    @cached_property
    def rank(self) -> Ints:
        """(n,) place of every exposure in this order."""
        return np.argsort(self.order)

    @property
    def front_of(self) -> Ints:
        """(n,) the front in which each exposure is eliminated."""
        return np.repeat(np.arange(len(self.fronts)), [front.own for front in self.fronts])[self.rank]

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """The fronts whose parent each front is, ascending."""
        found: list[list[int]] = [[] for _ in self.fronts]
        for index, front in enumerate(self.fronts):
            if front.parent >= 0:
                found[front.parent].append(index)
        return tuple(map(tuple, found))

    def rows(self, border: int) -> list[tuple[slice, Ints]]:
        """Rows of the own and of the other unknowns of each front in a vector in the order of elimination.

        The system parameters come last; they are the root's own.
        """
        if border not in self._rows:
            self._rows[border] = self._find_rows(6 * self.pattern.events + border, border)
        return self._rows[border]

    def _find_rows(self, size: int, border: int) -> list[tuple[slice, Ints]]:
        found, first = list[tuple[slice, Ints]](), 0
        for front in self.fronts:
            last = first + 6 * front.own
            if front.parent < 0:
                found.append((slice(first, size), np.zeros(0, dtype=np.int64)))
            else:
                rest = self.rank[front.images[front.own :]]
                found.append((slice(first, last), scalars(rest, size, border)))
            first = last
        return found


@dataclass(frozen=True, eq=False)
class FactoredFront:
    """L (p, p), of which the lower triangle counts, and M (q, p) of one front, Fortran order."""

    lower: Floats
    below: Floats


def _fronts(pattern: Covisibility, dissection: Dissection) -> tuple[Front, ...]:
    """Place every block of the pattern and every boundary in the fronts."""
    parts = dissection.parts
    images = [np.concatenate([part.own, part.boundary]) for part in parts]
    every = _held(pattern, images, [len(part.own) for part in parts])
    place = np.empty(pattern.events, dtype=np.int64)
    fronts = []
    for index, (part, held) in enumerate(zip(parts, every, strict=True)):
        if part.parent >= 0:
            place[images[part.parent]] = np.arange(len(images[part.parent]))
        fronts.append(
            Front(
                own=len(part.own),
                rest=len(part.boundary),
                images=images[index],
                parent=part.parent,
                height=part.height,
                in_parent=place[part.boundary] if part.parent >= 0 else np.empty(0, dtype=np.int64),
                held=held,
            )
        )
    return tuple(fronts)


def _held(pattern: Covisibility, images: Sequence[Ints], own: Sequence[int]) -> Iterator[HeldBlocks]:
    """The blocks of each front in the order of elimination: those of the exposures it eliminates first.

    An exposure that is not in the front has the place −1 there.
    """
    eliminated = np.concatenate([of[:count] for of, count in zip(images, own, strict=True)])
    rank = np.empty(pattern.events, dtype=np.int64)
    rank[eliminated] = np.arange(len(rank))
    part_of_rank = np.repeat(np.arange(len(own)), own)
    row, column = pattern.row, pattern.column
    owner = part_of_rank[np.minimum(rank[row], rank[column])]
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(len(own) + 1))
    place = np.full(pattern.events, -1, dtype=np.int64)
    for index, of in enumerate(images):
        mine = order[starts[index] : starts[index + 1]]
        place[of] = np.arange(len(of))
        at_row, at_column = place[row[mine]], place[column[mine]]
        place[of] = -1
        # Block (i, j) of the pattern is at row i; below the diagonal it is transposed.
        yield HeldBlocks(
            mine, np.maximum(at_row, at_column), np.minimum(at_row, at_column), at_row < at_column
        )


def scalars(exposures: Ints, size: int, border: int) -> Ints:
    """Scalar indices of exposures in a front of the given size, and of its system parameters."""
    return np.concatenate([six_each(exposures), np.arange(size - border, size)])


def six_each(exposures: Ints) -> Ints:
    """Scalar indices of exposures."""
    return np.asarray((6 * exposures[:, None] + np.arange(6)).ravel())
