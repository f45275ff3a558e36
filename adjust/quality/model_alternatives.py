"""Tests whether the model of an adjustment lacks something: score statistics of alternatives.

An alternative adds C b to the computed observations: a lever arm that was not given, the camera's focal
length in one flight, a shift of the control. With whitened columns C, whitened misclosures w at the adjusted
values, the design matrix A and Q = (AᵀA)⁻¹

    s = Cᵀ w,    M = Cᵀ C − Cᵀ A Q Aᵀ C,    b̂ = M⁻¹ s,    T = sᵀ M⁻¹ s

T is distributed as χ² with as many degrees of freedom as there are columns if the model is complete, and b̂ is
what a full adjustment with b free would find, exactly so for linear equations (Rao 1948; Teunissen 2006,
ch. 4 and 5). Nothing is adjusted again: every column costs one solution with the factors that are there.

An error b that stays in moves the unknowns by Q Aᵀ C b. The smallest |b| that a test finds with a stated
power is δ0 / √M; what that does to an unknown is the external reliability of the model (Baarda 1968).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.observations.base import Linearization, ObservationGroup, Term
from adjust.observations.control_point import ControlPoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout, State
from adjust.quality.redundancy import NON_CENTRALITY
from adjust.solve.factorization import Factorization
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.normal_equations import System, whiten

#: Part of a column's own squares CᵀC that must be left beside the unknowns: less is rounding, and the
#: alternative cannot be told from what is estimated.
INDISTINGUISHABLE = 1e-9

_ALTERNATIVE = "alternative"


class ModelAlternative(Protocol):
    """Something that the model may lack, with one unknown size b."""

    @property
    def name(self) -> str:
        """What it is, unique among those tested together."""
        ...

    def column(self, group: ObservationGroup, equations: Linearization) -> Floats | None:
        """Derivatives (n, m) of the computed observations of a group with respect to b; None: all zero."""
        ...


@dataclass(frozen=True, eq=False)
class ParameterAlternative:
    """A system parameter that is held, or one that is free and differs for some of the images.

    Attributes
    ----------
    name : what it is.
    family, entity, component : which parameter: name of its family, indices in it.
    images : (n,) images of the block for which it differs; None: all of them.
    """

    name: str
    family: str
    entity: int
    component: int
    images: Bools | None = None

    def column(self, group: ObservationGroup, equations: Linearization) -> Floats | None:
        """The derivatives with respect to the parameter, of the observations in these images."""
        column = np.zeros_like(equations.misclosure)
        found = False
        for term in equations.terms:
            if term.block != self.family:
                continue
            touched = term.index == self.entity
            if self.images is not None:
                touched &= self.images[group.image] & (group.image >= 0)
            column += np.where(touched[:, None], term.jacobian[:, :, self.component], 0.0)
            found |= bool(touched.any())
        return column if found else None


@dataclass(frozen=True, eq=False)
class ControlAlternative:
    """The datum of all control points, moved in one way.

    Attributes
    ----------
    name : what it is.
    displacement : (points, 3) of every object point of the block for b = 1, local axes, metres.
    """

    name: str
    displacement: Floats

    def column(self, group: ObservationGroup, equations: Linearization) -> Floats | None:
        """What the displacements of its points do to the computed control."""
        if not isinstance(group, ControlPoints):
            return None
        column = np.zeros_like(equations.misclosure)
        for term in equations.terms:
            if term.block == OBJECT_POINT:
                column += np.einsum("nij,nj->ni", term.jacobian, self.displacement[term.index])
        return column


@dataclass(frozen=True, eq=False)
class AlternativeTests:
    """Score statistics of k alternatives, each against the model as it was adjusted.

    Attributes
    ----------
    names : of the alternatives.
    score : (k,) s.
    normal : (k, k) M; zero rows and columns of those that cannot be told from the unknowns.
    effect : (g, k) what the system parameters that are free change by for b = 1: the columns Q Aᵀ C.
    """

    names: tuple[str, ...]
    score: Floats
    normal: Floats
    effect: Floats

    @property
    def distinguishable(self) -> Bools:
        """(k,) whether an alternative can be told from the unknowns at all."""
        return np.asarray(np.diagonal(self.normal) > 0.0)

    @property
    def estimate(self) -> Floats:
        """(k,) b̂ of each alternative alone, its own unit; NaN where it cannot be told."""
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
        ValueError : if they cannot be told from the unknowns, or from each other.
        """
        chosen = list(members)
        own = self._own[chosen]
        if np.isnan(own).any():
            raise ValueError("an alternative cannot be told from the unknowns")
        # Units of many kinds in one matrix: scaled to a unit diagonal first.
        scale = 1.0 / np.sqrt(own)
        correlation = self.normal[np.ix_(chosen, chosen)] * scale[:, None] * scale[None, :]
        if np.linalg.eigvalsh(correlation)[0] < INDISTINGUISHABLE:
            raise ValueError("the alternatives cannot be told from each other")
        solved = np.linalg.solve(correlation, scale * self.score[chosen])
        return float(scale * self.score[chosen] @ solved), scale * solved

    @property
    def _own(self) -> Floats:
        return np.where(self.distinguishable, np.diagonal(self.normal), np.nan)


def alternative_tests(
    system: System, state: State, factorization: Factorization, alternatives: Sequence[ModelAlternative]
) -> AlternativeTests:
    """Test alternatives against a model that was adjusted.

    Parameters
    ----------
    state, factorization : of the adjusted values, and of the normal equations there.
    """
    layout, k = system.layout, len(alternatives)
    score, own = np.zeros(k), np.zeros((k, k))
    load = FullVectors(
        np.zeros((layout.images, 6, k)), np.zeros((layout.border, k)), np.zeros((layout.points, 3, k))
    )
    for group in system.observations.groups:
        equations = _with_columns(group, state, alternatives)
        if equations is None:
            continue
        white = whiten(group, equations)
        columns = np.sum([term.jacobian for term in white.terms if term.block == _ALTERNATIVE], axis=0)
        score += np.einsum("nmk,nm->k", columns, white.misclosure)
        own += np.einsum("nmk,nml->kl", columns, columns)
        _add_products(load, layout, white, columns)
    solved = solve_full(system, state, factorization, load)
    normal = own - load.dot(solved)
    told = np.diagonal(normal) > INDISTINGUISHABLE * np.diagonal(own)
    kept = told[:, None] & told[None, :]
    names = tuple(alternative.name for alternative in alternatives)
    return AlternativeTests(names, score, np.where(kept, 0.5 * (normal + normal.T), 0.0), solved.of_border)


def _with_columns(
    group: ObservationGroup, state: State, alternatives: Sequence[ModelAlternative]
) -> Linearization | None:
    """The equations of a group with the columns of all alternatives as one more term; None without any."""
    equations = group.linearize(state)
    columns = [alternative.column(group, equations) for alternative in alternatives]
    if all(column is None for column in columns):
        return None
    nothing = np.zeros_like(equations.misclosure)
    jacobian = np.stack([nothing if column is None else column for column in columns], axis=2)
    term = Term(_ALTERNATIVE, np.arange(len(nothing)), jacobian)
    present = group.stochastic.present
    terms = tuple(
        Term(one.block, one.index, np.where(present[:, :, None], one.jacobian, 0.0))
        for one in (*equations.terms, term)
    )
    return Linearization(np.where(present, equations.misclosure, 0.0), terms)


def _add_products(load: FullVectors, layout: ParameterLayout, white: Linearization, columns: Floats) -> None:
    """Add Aᵀ C of a whitened group."""
    for term in white.terms:
        if term.block == _ALTERNATIVE:
            continue
        products = np.swapaxes(term.jacobian, 1, 2) @ columns
        if term.block == EXTERIOR_ORIENTATION:
            np.add.at(load.of_exposures, term.index, products)
        elif term.block == OBJECT_POINT:
            np.add.at(load.of_points, term.index, products)
        else:
            places = layout.columns[term.block][term.index]
            free = places >= 0
            np.add.at(load.of_border, places[free], products[free])
