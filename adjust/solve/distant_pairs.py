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
from adjust.solve.fronts import FactoredFront, Front, HelmertBlocking, scalars
from adjust.solve.lanes import in_order


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

    def lifted(self, fronts: Sequence[Front], factors: Sequence[FactoredFront], threads: int) -> LiftedPairs:
        """The pairs with the vectors W of all exposures in the fronts where they meet others."""
        keys = np.stack([self.fronts, self.images, np.stack([self.meeting] * 2, 1)]).reshape(3, -1)
        front, image, meeting = np.unique(keys, axis=1)
        vectors: dict[int, list[tuple[Ints, Floats]]] = {}

        def lift(start: int) -> list[tuple[int, Ints, Floats]]:
            own = front == start
            return _lifted(fronts, factors, start, image[own], meeting[own])

        for found in in_order(lift, [int(start) for start in np.unique(front)], threads):
            for wanted, own, vector in found:
                vectors.setdefault(wanted, []).append((own, vector))
        return LiftedPairs(self, vectors)


@dataclass(frozen=True, eq=False)
class LiftedPairs:
    """Pairs, and exposures (e,) with their W (s, 6 e) for every front of s unknowns where some meet."""

    pairs: DistantPairs
    vectors: dict[int, list[tuple[Ints, Floats]]]

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
        image = np.concatenate([own for own, _ in self.vectors[front]])
        vectors = np.concatenate([vector for _, vector in self.vectors[front]], axis=1)
        order = np.argsort(image)
        of_one, of_other = (order[np.searchsorted(image[order], side)] for side in (one, other))
        wanted, of_wanted = np.unique(of_other, return_inverse=True)
        chosen = np.asfortranarray(vectors[:, (6 * wanted[:, None] + np.arange(6)).ravel()])
        products = np.empty_like(chosen)
        dense_algebra.negative_product(inverse, chosen, products)
        left = vectors.T.reshape(len(image), 6, len(vectors))[of_one]
        right = products.T.reshape(len(wanted), 6, len(vectors))[of_wanted]
        found = -scale[one][:, :, None] * (left @ right.swapaxes(1, 2)) * scale[other][:, None, :]
        blocks[self.pairs.block[here]] = np.where((one < other)[:, None, None], found, found.swapaxes(1, 2))


def _lifted(
    fronts: Sequence[Front], factors: Sequence[FactoredFront], start: int, image: Ints, meeting: Ints
) -> list[tuple[int, Ints, Floats]]:
    """W of some exposures (e,) of a front, in the fronts (e,) where each is wanted."""
    every, index = np.unique(image), start
    front, factor = fronts[start], factors[start]
    load = np.zeros((sum(factor.below.shape), 6 * len(every)))
    row = 6 * np.searchsorted(front.images[: front.own], every)[:, None] + np.arange(6)
    load[row.ravel(), np.arange(6 * len(every))] = 1.0
    found = []
    for wanted in np.unique(meeting):
        while index < wanted:
            p = factor.below.shape[1]
            own = load[:p]
            dense_algebra.solve_lower(factor.lower, own)
            left = load[p:] - factor.below @ own
            border = len(left) - 6 * front.rest
            at, index = front.in_parent, front.parent
            front, factor = fronts[index], factors[index]
            size = 6 * (front.own + front.rest) + border
            load = np.zeros((size, left.shape[1]))
            load[scalars(at, size, border)] = left
        own = image[meeting == wanted]
        columns = (6 * np.searchsorted(every, own)[:, None] + np.arange(6)).ravel()
        found.append((int(wanted), own, load[:, columns]))
    return found
