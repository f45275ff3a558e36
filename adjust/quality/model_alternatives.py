"""Tests whether the model of an adjustment lacks something: score statistics of alternatives.

An alternative adds C b to the computed observations: a lever arm that was not given, the camera's focal
length in one flight, a shift of the control. With whitened columns C, whitened misclosures w at the adjusted
values, the design matrix A and Q = (AᵀA)⁻¹

    s = Cᵀ (w − A Q Aᵀ w),    M = Cᵀ C − Cᵀ A Q Aᵀ C,    b̂ = M⁻¹ s,    T = sᵀ M⁻¹ s

Aᵀ w is zero at the minimum; the little that the iteration leaves of it counts where M is small. T is
distributed as χ² with as many degrees of freedom as there are columns if the model is complete, and b̂ is
what a full adjustment with b free would find, exactly so for linear equations (Rao 1948; Teunissen 2006,
ch. 4 and 5). Nothing is adjusted again: every column costs one solution with the factors that are there.

Errors of considered parameters g with the covariance C_g explain misclosures, too. They are eliminated with
what is known of them, s ← s − M_bg (C_g⁻¹ + M_gg)⁻¹ s_g and M likewise, so that T keeps its distribution.

An error b that stays in moves the unknowns by Q Aᵀ C b. The smallest |b| that a test finds with a stated
power is δ0 / √M; what that does to an unknown is the external reliability of the model (Baarda 1968).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.observations.base import Linearization, ObservationGroup
from adjust.parameters import ConsideredParameters
from adjust.quality.alternative_products import ModelAlternative, products_of
from adjust.quality.detectability import INDISTINGUISHABLE, NON_CENTRALITY
from adjust.solve.full_vectors import SparseVectors, inverse_products, solve_full
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System

#: The same in addition to other alternatives: what is left says nothing of its own.
_LEFT_OVER = 1e-4


@dataclass(frozen=True, eq=False)
class ParameterAlternative:
    """A system parameter that is held, or one that is free and differs for some of the events.

    Attributes
    ----------
    family, entity, component : which parameter: name of its family, indices in it; None: of all entities.
    events : (n,) events of the block for which it differs; None: all of them.
    """

    family: str
    entity: int | None
    component: int
    events: Bools | None = None

    def column(self, group: ObservationGroup, equations: Linearization, _: slice, /) -> Floats | None:
        """The derivatives with respect to the parameter, of the observations of these events."""
        column = None
        for term in equations.terms:
            if term.block != self.family:
                continue
            touched = (
                np.ones(len(term.index), dtype=bool) if self.entity is None else term.index == self.entity
            )
            if self.events is not None:
                touched &= self.events[group.event] & (group.event >= 0)
            if touched.any():
                own = np.where(touched[:, None], term.jacobian[:, :, self.component], 0.0)
                column = own if column is None else column + own
        return column


@dataclass(frozen=True, eq=False)
class ObservationAlternative:
    """All observations of one group, changed in one way: what no parameter of the model describes.

    Attributes
    ----------
    group : name of the group.
    change : (n, m) what b = 1 adds to the computed observations; or a function of some rows that returns
        theirs, for what is too large to be there as a whole.
    also : what it changes of another group.
    """

    group: str
    change: Floats | Callable[[slice], Floats]
    also: ObservationAlternative | None = None

    def column(self, group: ObservationGroup, equations: Linearization, rows: slice, /) -> Floats | None:
        """The change, of the group it belongs to."""
        if group.name == self.group:
            return self.change(rows) if callable(self.change) else self.change[rows]
        return None if self.also is None else self.also.column(group, equations, rows)


@dataclass(frozen=True, eq=False)
class AlternativeTests:
    """Score statistics of k alternatives, each against the model as it was adjusted.

    Attributes
    ----------
    score : (k,) s.
    normal : (k, k) M; zero rows and columns of those that cannot be separated from the unknowns.
    effect : (g, k) what the system parameters that are free change by for b = 1: the columns Q Aᵀ C; in the
        datum of a free network.
    acting : (k,) whether an alternative changes any observation: the boresight does not without attitudes.
    """

    score: Floats
    normal: Floats
    effect: Floats
    acting: Bools

    def only(self, chosen: Bools) -> AlternativeTests:
        """Those of some of the alternatives (k,)."""
        normal = self.normal[np.ix_(chosen, chosen)]
        return AlternativeTests(self.score[chosen], normal, self.effect[:, chosen], self.acting[chosen])

    @property
    def distinguishable(self) -> Bools:
        """(k,) whether an alternative can be separated from the unknowns at all."""
        return np.asarray(np.diagonal(self.normal) > 0.0)

    @property
    def estimate(self) -> Floats:
        """(k,) b̂ of each alternative alone, its own unit; NaN where it cannot be determined."""
        return np.asarray(self.score / self._own)

    @property
    def sigma(self) -> Floats:
        """(k,) standard deviation of the estimate for σ0 = 1; NaN likewise."""
        return np.asarray(1.0 / np.sqrt(self._own))

    @property
    def t(self) -> Floats:
        """(k,) estimate over σ: standard normal if the model is complete and σ0 = 1; NaN likewise."""
        return np.asarray(self.score / np.sqrt(self._own))

    @property
    def detectable(self) -> Floats:
        """(k,) smallest |b| found at α0 = 0.1 % with a power of 80 %, for σ0 = 1; NaN likewise."""
        return NON_CENTRALITY * self.sigma

    def joint(self, members: Sequence[int]) -> tuple[float, Floats]:
        """T and b̂ (j,) of some alternatives together.

        Raises
        ------
        ValueError : if they cannot be separated from the unknowns, or from each other.
        """
        chosen = list(members)
        own = self._own[chosen]
        if np.isnan(own).any():
            raise ValueError("an alternative cannot be separated from the unknowns")
        # Units of many kinds in one matrix: scaled to a unit diagonal first.
        scale = 1.0 / np.sqrt(own)
        correlation = self.normal[np.ix_(chosen, chosen)] * scale[:, None] * scale[None, :]
        if np.linalg.eigvalsh(correlation)[0] < INDISTINGUISHABLE:
            raise ValueError("the alternatives cannot be separated from each other")
        solved = np.linalg.solve(correlation, scale * self.score[chosen])
        return float(scale * self.score[chosen] @ solved), scale * solved

    @property
    def correlation(self) -> Floats:
        """(k, k) of the scores: alternatives near ±1 explain the same misclosures; NaN where not told."""
        spread = np.sqrt(self._own)
        return self.normal / spread[:, None] / spread

    def together(self, members: Sequence[int]) -> tuple[float, int]:
        """T of some alternatives together, and its degrees of freedom, as far as they can be separated."""
        chosen = [k for k in members if self.distinguishable[k]]
        scale = 1.0 / np.sqrt(self._own[chosen])
        values, vectors = np.linalg.eigh(self.normal[np.ix_(chosen, chosen)] * scale[:, None] * scale)
        told = values > _LEFT_OVER
        projected = vectors[:, told].T @ (scale * self.score[chosen])
        return float(np.sum(projected**2 / values[told])), int(told.sum())

    def joint_sigma(self, members: Sequence[int]) -> Floats:
        """Standard deviations (j,) of the estimates of some alternatives together, for σ0 = 1."""
        chosen = list(members)
        return np.sqrt(np.diagonal(np.linalg.inv(self.normal[np.ix_(chosen, chosen)])))

    def explanation(self, critical: Floats | float) -> tuple[int, ...]:
        """The alternatives that explain the misclosures together, each after those before it.

        The first has the largest |t| of those that exceed their critical value, one or (k,); every further
        one likewise, in addition to all before it (detection, identification, adaptation: Teunissen 2006, ch.
        4).
        """
        found: list[int] = []
        score, normal, own = self.score.copy(), self.normal.copy(), np.nan_to_num(self._own)
        while True:
            left = np.diagonal(normal)
            # What the ones before it leave of an alternative may be rounding alone.
            told = left > _LEFT_OVER * own
            t = np.where(told, score, 0.0) / np.sqrt(np.where(told, left, 1.0))
            significant = np.flatnonzero(np.abs(t) > critical)
            if not len(significant):
                return tuple(found)
            best = int(significant[np.argmax(np.abs(t[significant]))])
            found.append(best)
            column = normal[:, best] / normal[best, best]
            score = score - column * score[best]
            normal = normal - np.outer(column, normal[best])

    @property
    def _own(self) -> Floats:
        return np.where(self.distinguishable, np.diagonal(self.normal), np.nan)


def alternative_tests(
    system: System, solution: Solution, alternatives: Sequence[ModelAlternative]
) -> AlternativeTests:
    """Test alternatives against a model that was adjusted."""
    state = solution.linearization
    known = system.block.considered
    considered = () if known is None else considered_alternatives(known)
    count = len(alternatives)
    products = products_of(system, state, (*alternatives, *considered))
    of_datum = _moved_by_datum(system, solution, products.load)
    of_unknowns, effect = inverse_products(system, state, solution.factorization, products.load)
    own, left = products.own, products.own - of_unknowns
    if known is not None:
        left = _eliminated(left, count, known.root)
    normal, score = left[:count, :count], left[:count, -1]
    told = np.diagonal(normal) > INDISTINGUISHABLE * np.diagonal(own)[:count]
    kept = told[:, None] & told[None, :]
    return AlternativeTests(
        score,
        np.where(kept, 0.5 * (normal + normal.T), 0.0),
        (effect - of_datum)[: system.layout.border, :count],
        np.diagonal(own)[:count] > 0.0,
    )


def _moved_by_datum(system: System, solution: Solution, load: SparseVectors) -> Floats:
    """G G_selᵀ N⁻¹ b of the border (g, k): what the inner constraints of a free network take off effects."""
    movements = solution.movements
    if movements is None or not np.any(movements.vectors.of_border):
        return np.zeros_like(load.of_border)
    z = solve_full(system, solution.linearization, solution.factorization, movements.selected)
    return np.asarray(movements.vectors.of_border @ load.products_with(z))


def considered_alternatives(known: ConsideredParameters) -> tuple[ParameterAlternative, ...]:
    """Other values of considered parameters as alternatives of the model."""
    return tuple(ParameterAlternative(*place) for place in known.places)


def _eliminated(products: Floats, first: int, root: Floats) -> Floats:
    """Products without the considered parameters, which follow from ``first`` on; root (k, k) of C_g."""
    own = slice(first, first + len(root))
    mixed = products[:, own] @ root
    inner = np.eye(len(root)) + root.T @ products[own, own] @ root
    return np.asarray(products - mixed @ np.linalg.solve(inner, mixed.T))
