"""Influence of the observations on the system parameters estimated from them.

An estimate is a linear function of the observations, to first order: with the design matrix A, the weight
matrix P and Q = (AᵀPA)⁻¹,

    dp̂ = Q_p· Aᵀ P dl,    Cov(p̂, l) = Q_p· Aᵀ.

Q_p· is one solution with the factors that are there for each parameter p: its own cofactors and those with
the exposures, the other parameters and the object points. So whatever uses the estimates *and* the
observations again knows what their errors have in common.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup
from adjust.one_thread import one_thread
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout
from adjust.result import AdjustmentResult
from adjust.solve.free_network import OpenMovements
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.system import System

# Solutions at once: each is as large as all unknowns.
_AT_ONCE = 10


@dataclass(frozen=True, eq=False)
class ParameterInfluence:
    """What k system parameters change by with each of n observations of one group.

    Attributes
    ----------
    group : the observations that were used, weighted as in the adjustment.
    derivative : (k, n, m) of the parameters by the observed components, SI and radians or the families' own
        units; zero for what is not used.
    """

    group: ObservationGroup
    derivative: Floats


def parameter_influences(result: AdjustmentResult, columns: Ints) -> tuple[ParameterInfluence, ...]:
    """Influence of all observations but the image points on some system parameters.

    Parameters
    ----------
    columns : (k,) of the border.
    """
    system, solution = result.system, result.solution
    groups = system.observations.others
    with one_thread():
        equations = [group.linearize(solution.linearization) for group in groups]
        found = [np.zeros((len(columns), *item.misclosure.shape)) for item in equations]
        for start in range(0, len(columns), _AT_ONCE):
            part = columns[start : start + _AT_ONCE]
            load = _in_datum(_units(system, part), solution.movements)
            cofactors = solve_full(system, solution.linearization, solution.factorization, load)
            for number, (group, item) in enumerate(zip(groups, equations, strict=True)):
                for k in range(len(part)):
                    computed = _along(item, cofactors, k, system.layout)
                    present = np.where(group.stochastic.present, computed, 0.0)
                    found[number][start + k] = group.stochastic.weighted(present)
    return tuple(ParameterInfluence(*pair) for pair in zip(groups, found, strict=True))


def _units(system: System, columns: Ints) -> FullVectors:
    """Vectors of one at a system parameter each."""
    layout, count = system.layout, len(columns)
    of_border = np.zeros((system.border, count))
    of_border[columns, np.arange(count)] = 1.0
    return FullVectors(np.zeros((layout.events, 6, count)), of_border, np.zeros((layout.points, 3, count)))


def _in_datum(units: FullVectors, movements: OpenMovements | None) -> FullVectors:
    """Sᵀ e with S = I − G G_selᵀ, which leads to the datum of a free network."""
    if movements is None:
        return units
    return units.minus(movements.selected.times(movements.vectors.dot(units)))


def _along(equations: Linearization, vectors: FullVectors, number: int, layout: ParameterLayout) -> Floats:
    """A x (n, m) with one of the vectors."""
    total = np.zeros_like(equations.misclosure)
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            unknown = vectors.of_exposures[term.index, :, number]
        elif term.block == OBJECT_POINT:
            unknown = vectors.of_points[term.index, :, number]
        else:
            column = layout.columns[term.block][term.index]
            unknown = np.where(column >= 0, vectors.of_border[column, number], 0.0)
        total += np.einsum("nij,nj->ni", term.jacobian, unknown)
    return total
