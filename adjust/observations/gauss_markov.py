"""Errors correlated over time: a first-order Gauss–Markov process along every strip.

Standardized errors of exposures i, j of one strip have the correlation exp(−|t_i − t_j|/τ). Such a
process knows nothing of its past but its last value, so the inverse T of the correlation matrix is
tridiagonal along a strip (Gelb 1974, section 3.8). With φ = exp(−Δt/τ) towards the neighbours before (b)
and after (a),

    T_ii = 1/(1 − φ_b²) + φ_a²/(1 − φ_a²),    T_ib = −φ_b/(1 − φ_b²),    T_ia = −φ_a/(1 − φ_a²)

and T = DᵀD with the bidiagonal D that makes the errors white: row i holds 1/√(1 − φ_b²) for itself and
−φ_b/√(1 − φ_b²) for the one before. Where there is no neighbour φ is 0. What is not used is skipped:
its neighbours become each other's, with the times between them added up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy.linalg

from adjust.arrays import Bools, Floats, Ints
from adjust.errors import InconsistentBlockError


@dataclass(frozen=True, eq=False)
class Stencil:
    """Coefficients (n,) of an observation and of its neighbours before and after."""

    own: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Every observation between the nearest ones of its strip that are used.

    One that is not used has neighbours, too: those it would have if it did.

    Attributes
    ----------
    before, after : (n,) indices; an observation's own index where there is none.
    of_before, of_after : (n,) correlations φ with them, 0 where there is none.
    free_of_before, free_of_after : (n,) 1 − φ².
    sequence : (k,) those that are used, strip by strip in the order of time.
    """

    before: Ints
    after: Ints
    of_before: Floats
    of_after: Floats
    free_of_before: Floats
    free_of_after: Floats
    sequence: Ints

    @cached_property
    def taking_part(self) -> Bools:
        """(n,) the observations that are used."""
        mask = np.zeros(len(self.before), dtype=bool)
        mask[self.sequence] = True
        return mask

    @cached_property
    def whitening(self) -> Stencil:
        """Rows of D; zero for what is not used."""
        scale = np.where(self.taking_part, 1.0 / np.sqrt(self.free_of_before), 0.0)
        return Stencil(scale, -self.of_before * scale, np.zeros_like(scale))

    @cached_property
    def weights(self) -> Stencil:
        """Rows of T; for what is not used the row it would have if it did."""
        return Stencil(
            1.0 / self.free_of_before + self.of_after**2 / self.free_of_after,
            -self.of_before / self.free_of_before,
            -self.of_after / self.free_of_after,
        )

    def weights_derivative(self, before: Floats, after: Floats) -> Stencil:
        """Rows of dT for changes (n,) of φ towards the neighbours; zero for what is not used."""
        before, after = (np.where(self.taking_part, change, 0.0) for change in (before, after))
        return Stencil(
            2.0 * self.of_before * before / self.free_of_before**2
            + 2.0 * self.of_after * after / self.free_of_after**2,
            -(1.0 + self.of_before**2) * before / self.free_of_before**2,
            -(1.0 + self.of_after**2) * after / self.free_of_after**2,
        )

    def combined(self, stencil: Stencil, vectors: Floats) -> Floats:
        """Own and neighbouring vectors (n, …) by the coefficients of a stencil."""
        shape = (-1, *(1,) * (vectors.ndim - 1))
        return np.asarray(
            stencil.own.reshape(shape) * vectors
            + stencil.before.reshape(shape) * vectors[self.before]
            + stencil.after.reshape(shape) * vectors[self.after]
        )

    def correlated(self, white: Floats, transposed: bool = False) -> Floats:
        """D⁻¹ (or D⁻ᵀ) times white vectors (n, m): errors with the correlations of the process."""
        result = np.zeros_like(white)
        rows = self.sequence
        if len(rows) == 0:
            return result
        # Neighbours follow each other in the sequence; between strips the coefficient is zero.
        band = np.zeros((2, len(rows)))
        diagonal, beside = self.whitening.own[rows], self.whitening.before[rows[1:]]
        if transposed:
            band[1], band[0, 1:] = diagonal, beside
        else:
            band[0], band[1, :-1] = diagonal, beside
        sides = (0, 1) if transposed else (1, 0)
        result[rows] = scipy.linalg.solve_banded(sides, band, white[rows], check_finite=False)
        return result


@dataclass(frozen=True, eq=False)
class GaussMarkov:
    """When the observations of a group were made, and how long their errors last.

    Attributes
    ----------
    strip : (n,) index of the strip; errors of different strips are independent.
    time : (n,) seconds, on a scale that is continuous within a strip.
    correlation_time : τ, seconds.
    """

    strip: Ints
    time: Floats
    correlation_time: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.time).all():
            raise InconsistentBlockError("The time of an observation with correlated errors is not known.")
        if not (np.isfinite(self.correlation_time) and self.correlation_time > 0.0):
            raise InconsistentBlockError("A correlation time must be positive and finite.")
        if np.any(self._steps <= 0.0):
            raise InconsistentBlockError(
                "Two observations of a strip were made at the same time; their errors would be the same."
            )

    @cached_property
    def _order(self) -> Ints:
        """Strip by strip in the order of time."""
        return np.lexsort((self.time, self.strip))

    @cached_property
    def _steps(self) -> Floats:
        """Times between successive observations of a strip."""
        steps = np.diff(self.time[self._order])
        return np.asarray(steps[np.diff(self.strip[self._order]) == 0])

    @property
    def interval(self) -> float:
        """Median time between successive observations of a strip, seconds; NaN without any."""
        return float(np.median(self._steps)) if len(self._steps) else float("nan")

    @property
    def exposures_of_a_strip(self) -> float:
        """Mean number of observations of the strips with more than one; 1 without any."""
        strips = len(np.unique(self.strip[self._order][1:][np.diff(self.strip[self._order]) == 0]))
        return 1.0 + len(self._steps) / max(strips, 1)

    @property
    def longest_strip(self) -> float:
        """Time from the first to the last observation of the longest strip, seconds."""
        if len(self.time) == 0:
            return 0.0
        strips, index = np.unique(self.strip, return_inverse=True)
        first, last = np.full(len(strips), np.inf), np.full(len(strips), -np.inf)
        np.minimum.at(first, index, self.time)
        np.maximum.at(last, index, self.time)
        return float(np.max(last - first))

    def with_correlation_time(self, seconds: float) -> Self:
        """The same observations with errors that last so long."""
        return replace(self, correlation_time=seconds)

    def neighbours(self, taking_part: Bools) -> Neighbours:
        """The neighbours of all observations among those (n,) that are used."""
        order = self._order
        place = np.arange(len(order))
        there = taking_part[order]
        # Last place before, and first place after, that is used; −1 and n for none.
        last = np.maximum.accumulate(np.where(there, place, -1))
        following = np.minimum.accumulate(np.where(there, place, len(order))[::-1])[::-1]
        earlier = np.concatenate([[-1], last[:-1]])[: len(order)]
        later = np.concatenate([following[1:], [len(order)]])[: len(order)]
        before, of_before, free_of_before = self._linked(order, earlier)
        after, of_after, free_of_after = self._linked(order, later)
        return Neighbours(before, after, of_before, of_after, free_of_before, free_of_after, order[there])

    def _linked(self, order: Ints, place: Ints) -> tuple[Ints, Floats, Floats]:
        """Index, φ and 1 − φ² (n,) of the neighbour whose place in the order is given."""
        own = np.arange(len(order))
        exists = (place >= 0) & (place < len(order))
        inside = np.where(exists, place, own)
        exists &= self.strip[order[inside]] == self.strip[order]
        index = np.empty_like(order)
        index[order] = order[np.where(exists, inside, own)]
        age = np.abs(self.time - self.time[index]) / self.correlation_time
        linked = index != own
        # Written so that neither of the two loses digits when the other is next to one.
        return index, np.where(linked, np.exp(-age), 0.0), np.where(linked, -np.expm1(-2.0 * age), 1.0)
