"""Blocks of the inverse between exposures that no front holds together.

The inverse Z of an exposure a follows from that of the later exposures R that its elimination connects,
Z_a = −G_aᵀ Z_R, and so on from front to front. In the front c where the ways of a and b come together

    Z_ab = W_aᵀ Z_c W_b,

with Z_c the inverse on all unknowns of c. W_a is what forward elimination leaves of a unit vector of a when
it arrives at c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.solve import dense_algebra
from adjust.solve.covisibility import Covisibility
from adjust.solve.fronts import FactoredFront, Front, HelmertBlocking, scalars, six_each


@dataclass(frozen=True, eq=False)
class DistantPairs:
    """k pairs of exposures that no front holds.

    Attributes
    ----------
    block : (k,) the place of their blocks in the pattern, which has the smaller index first.
    images : (k, 2) the exposures, the one that is eliminated first in front.
    fronts : (k, 2) where they are eliminated.
    meeting : (k,) the front where their ways come together.
    """

    block: Ints
    images: Ints
    fronts: Ints
    meeting: Ints

    @classmethod
    def of(cls, analysis: HelmertBlocking, pattern: Covisibility, block: Ints) -> DistantPairs:
        """Some blocks (k,) of a pattern."""
        images = np.stack([pattern.row[block], pattern.column[block]], axis=1)
        fronts = analysis.front_of[images]
        # Never the same front; the one that comes first is eliminated first.
        order = np.argsort(fronts, axis=1)
        images, fronts = np.take_along_axis(images, order, 1), np.take_along_axis(fronts, order, 1)
        parents = np.array([front.parent for front in analysis.fronts])
        first = np.arange(len(parents))  # front of those that go into each one
        for front, parent in enumerate(parents[:-1]):
            first[parent] = min(first[parent], first[front])
        meeting = fronts[:, 0]
        while (apart := (fronts[:, 1] < first[meeting]) | (fronts[:, 1] > meeting)).any():
            meeting = np.where(apart, parents[meeting], meeting)
        return cls(block, images, fronts, meeting)

    def lifted(self, fronts: Sequence[Front], factors: Sequence[FactoredFront]) -> LiftedPairs:
        """The pairs with the vectors W of all exposures in the fronts where they meet others.

        All that have come to a front are taken to the next one together, as far as they are wanted.
        """
        image, place = np.unique(self.images, return_inverse=True)
        start, last, column = (np.zeros(len(image), dtype=np.int64) for _ in range(3))
        place = place.reshape(self.images.shape)
        start[place] = self.fronts
        np.maximum.at(last, place, self.meeting[:, None])
        vectors: dict[int, tuple[Ints, Floats]] = {}
        arrived: dict[int, list[tuple[Ints, Ints, Floats]]] = {}
        for index, (front, factor) in enumerate(zip(fronts, factors, strict=True)):
            own, (q, p) = np.flatnonzero(start == index), factor.below.shape
            if not len(own) and index not in arrived:
                continue
            rows = six_each(np.searchsorted(front.images[: front.own], image[own]))
            parts = [(own, rows, np.eye(len(rows))), *arrived.pop(index, [])]
            here = np.concatenate([part[0] for part in parts])
            load = _side_by_side(p + q, [(rows, part) for _, rows, part in parts])
            column[here] = np.arange(len(here))
            wanted = np.unique(place[self.meeting == index])
            if len(wanted):
                vectors[index] = image[wanted], np.asfortranarray(load[:, six_each(column[wanted])])
            left = here[last[here] > index]
            if len(left):
                load = np.take(load, six_each(column[left]), axis=1)
                dense_algebra.solve_lower(factor.lower, load[:p])
                dense_algebra.subtract_rows(load[p:], factor.below, load[:p])
                size = sum(factors[front.parent].below.shape)
                rows = scalars(front.in_parent, size, q - 6 * front.rest)
                arrived.setdefault(front.parent, []).append((left, rows, load[p:]))
        return LiftedPairs(self, vectors)


@dataclass(frozen=True, eq=False)
class LiftedPairs:
    """Pairs with the vectors that they need.

    Attributes
    ----------
    pairs : k pairs.
    vectors : for fronts of s unknowns where some meet, exposures (e,), ascending, with W (s, 6 e).
    """

    pairs: DistantPairs
    vectors: dict[int, tuple[Ints, Floats]]

    def fill(self, front: int, inverse: Floats, scale: Floats, blocks: Floats) -> None:
        """Write the blocks of the pairs that meet in a front.

        Parameters
        ----------
        inverse : (s, s) lower triangle of Z_c, Fortran order.
        scale : (n, 6) factors of rows and columns of Z.
        blocks : (blocks, 6, 6) of the pattern.
        """
        if front not in self.vectors:
            return
        here = np.flatnonzero(self.pairs.meeting == front)
        one, other = self.pairs.images[here].T
        image, vectors = self.vectors[front]
        of_one, of_other = (np.searchsorted(image, side) for side in (one, other))
        wanted, of_wanted = np.unique(of_other, return_inverse=True)
        chosen = np.asfortranarray(vectors[:, six_each(wanted)])
        products = np.empty_like(chosen)
        dense_algebra.negative_product(inverse, chosen, products)
        left = vectors.T.reshape(len(image), 6, len(vectors))[of_one]
        right = products.T.reshape(len(wanted), 6, len(vectors))[of_wanted]
        found = -scale[one][:, :, None] * (left @ right.swapaxes(1, 2)) * scale[other][:, None, :]
        blocks[self.pairs.block[here]] = np.where((one < other)[:, None, None], found, found.swapaxes(1, 2))


def _side_by_side(rows: int, parts: Sequence[tuple[Ints, Floats]]) -> Floats:
    """Columns of parts side by side, each in its rows (k,) of so many; zeros elsewhere."""
    found, first = np.zeros((rows, sum(part.shape[1] for _, part in parts))), 0
    for at, part in parts:
        found[at, first : first + part.shape[1]] = part
        first += part.shape[1]
    return found
