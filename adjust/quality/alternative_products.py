"""Products of alternatives C of a model with each other and with the design matrix: CᵀC and AᵀC.

The image points are gone through some at a time. Their whitened equations, and the columns of the
alternatives at them, are never there as a whole: of half a million they would be hundreds of megabytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.compiled import kernel
from adjust.observations.base import Linearization, ObservationGroup, Term
from adjust.observations.image_point import ImagePoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.full_vectors import SparseVectors
from adjust.solve.system import System
from adjust.solve.whitening import whiten

# So many image points at a time, with all that is made of them, fit into the caches of a processor.
_AT_ONCE = 8_192


class ModelAlternative(Protocol):
    """A possible deficiency of the model, with one unknown size b."""

    def column(self, group: ObservationGroup, equations: Linearization, rows: slice, /) -> Floats | None:
        """Derivatives (n, m) of the computed observations with respect to b; None: all zero.

        Parameters
        ----------
        group, equations : n observations of a group, and their equations.
        rows : which of the whole group they are.
        """
        ...


class Products:
    """CᵀC and AᵀC of k columns C, summed up group by group.

    Attributes
    ----------
    own : (k, k) CᵀC.
    load : AᵀC; complete after ``finish``.
    """

    def __init__(self, system: System, count: int) -> None:
        self.layout = system.layout
        self.own = np.zeros((count, count))
        self.load = SparseVectors.zeros(system, count)
        self._numbers = np.zeros(0, dtype=np.int64)
        self._of_rays = np.zeros((system.layout.events, 6, 0))

    def add(
        self, group: ObservationGroup, equations: Linearization, columns: Sequence[tuple[int, Floats]]
    ) -> None:
        """Add what observations contribute; columns (n, m) of the alternatives with these numbers."""
        white, present = whiten(group, equations), group.stochastic.present
        numbers = np.array([k for k, _ in columns])
        # Column after column, as they are made: interleaved, every one of them would run through all memory.
        whitened = np.empty((len(columns), *white.misclosure.shape))
        complete = bool(present.all())
        for place, (_, column) in enumerate(columns):
            column = column if complete else np.where(present, column, 0.0)
            whitened[place] = group.stochastic.whitened(column)
        flat = whitened.reshape(len(columns), -1)
        self.own[np.ix_(numbers, numbers)] += flat @ flat.T
        for term in white.terms:
            if term.block == EXTERIOR_ORIENTATION:
                index, jacobian = map(np.ascontiguousarray, (term.index, term.jacobian))
                rays = isinstance(group, ImagePoints)
                sums, places = self._sums_of_rays(numbers) if rays else (self.load.of_exposures, numbers)
                _add_products(index, jacobian, whitened, places, sums)
            elif term.block == OBJECT_POINT:
                self.load = load = self.load.with_points_of(numbers)
                index, jacobian = map(np.ascontiguousarray, (term.index, term.jacobian))
                _add_products(index, jacobian, whitened, load.places_of(numbers), load.of_points)
            else:
                places = self.layout.columns[term.block]
                if np.any(places >= 0):
                    touched, summed = _summed(term, whitened)
                    free = places[touched] >= 0
                    self.load.of_border[np.ix_(places[touched][free], numbers)] += summed[free]

    def _sums_of_rays(self, numbers: Ints) -> tuple[Floats, Ints]:
        """Sums (n, 6, c) of some columns alone at the exposures, and the places of the columns in them.

        Image points come in the order of object points: in the load, of all columns, every one of them would
        be on other pages of memory.
        """
        if not np.array_equal(numbers, self._numbers):
            self.finish()
            self._numbers, self._of_rays = numbers, np.zeros((self.layout.events, 6, len(numbers)))
        return self._of_rays, np.arange(len(numbers))

    def finish(self) -> None:
        """Bring what image points have contributed into the load."""
        self.load.of_exposures[:, :, self._numbers] += self._of_rays
        self._of_rays[:] = 0.0


def products_of(system: System, state: State, alternatives: Sequence[ModelAlternative]) -> Products:
    """CᵀC and AᵀC of k alternatives and, as column k + 1, of the misclosures at a state."""
    last = len(alternatives)
    products = Products(system, last + 1)
    # The image points last: room for the columns at object points is then made once, before it is large.
    for whole in reversed(system.observations.groups):
        for group, rows in _parts(whole):
            equations = _present(group, group.linearize(state))
            found = [
                (k, column)
                for k, alternative in enumerate(alternatives)
                if (column := alternative.column(group, equations, rows)) is not None
            ]
            # The misclosures go through the same products as the columns.
            products.add(group, equations, [*found, (last, equations.misclosure)])
    products.finish()
    return products


def _parts(group: ObservationGroup) -> Iterator[tuple[ObservationGroup, slice]]:
    """Some image points at a time; any other group as a whole, because its errors may be correlated."""
    if not isinstance(group, ImagePoints):
        yield group, slice(0, len(group.event))
        return
    for first in range(0, len(group.image), _AT_ONCE):
        rows = slice(first, min(first + _AT_ONCE, len(group.image)))
        yield group.only(rows), rows


def _summed(term: Term, columns: Floats) -> tuple[Ints, Floats]:
    """The entities (e,) that one term touches, and Aᵀ C (e, d, k) of it with columns (k, n, m)."""
    touched, row = np.unique(term.index, return_inverse=True)
    result = np.zeros((len(touched), term.jacobian.shape[2], len(columns)))
    _add_products(row, np.ascontiguousarray(term.jacobian), columns, np.arange(len(columns)), result)
    return touched, result


def _present(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The equations with zeros for what is not used."""
    present = group.stochastic.present
    if present.all():
        return equations
    terms = tuple(
        Term(one.block, one.index, np.where(present[:, :, None], one.jacobian, 0.0))
        for one in equations.terms
    )
    return Linearization(np.where(present, equations.misclosure, 0.0), terms)


@kernel
def _add_products(index: Ints, jacobian: Floats, columns: Floats, numbers: Ints, result: Floats) -> None:
    """Add Aᵀ C of n observations to the unknowns they touch.

    index (n,) which; jacobian (n, m, d); columns (k, n, m) with their numbers (k,) in result
    (count, d, ·), which is changed.
    """
    n, m, d = jacobian.shape
    k = columns.shape[0]
    # Unsigned: a number that might be negative would be looked at for every product.
    place, mine = numbers.astype(np.uintp), np.empty((m, k))
    for i in range(n):
        for c in range(m):
            for t in range(k):
                mine[c, t] = columns[t, i, c]
        for j in range(d):
            sums = result[index[i], j]
            for c in range(m):
                derivative = jacobian[i, c, j]
                if derivative != 0.0:
                    for t in range(k):
                        sums[place[t]] += derivative * mine[c, t]
