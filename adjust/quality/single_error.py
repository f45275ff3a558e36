"""Effect of an error of a single observation, and its detectability.

With e_i the standardized errors of observation i (m components) and T the inverse of their correlations over
time (the unit matrix without any), an error of observation i alone shows in

    z_i = Σ_j T_ij u_j,    u = W v,    with the cofactor  T_ii I − Σ_jk T_ij G_jk T_ki,    G = A Q Aᵀ

because the neighbours' residuals let part of the error of i be expected. The sums run over i and its
neighbours in the strip, so they need the cofactors of successive exposures and of those on either side of
one. For an observation that is not used z_i is T_ii times the difference between it and its prediction
from the adjustment and its neighbours, and the second term is added in place of subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout, State
from adjust.quality.cofactor import Cofactor
from adjust.solve.whitening import add_border_columns, standardize


@dataclass(frozen=True, eq=False)
class SingleErrors:
    """Effect of an error of each observation of a group on itself.

    Attributes
    ----------
    pull : (n, m) z, of residuals adjusted − observed; without correlation over time u = W v.
    hat : (n, m, m) Σ_jk T_ij G_jk T_ki; without correlation the hat matrix G_ii.
    leverage : (n, m, m) L = Σ_j G_ij T_ji: the standardized observation has Q_vv P = I − L; without
        correlation the hat matrix.
    weight : (n,) T_ii; without correlation 1.
    considered : (n, m, m) what errors of considered parameters add to the cofactor of the pull, whether the
        observation is used or not.
    """

    pull: Floats
    hat: Floats
    leverage: Floats
    weight: Floats
    considered: Floats

    @property
    def inside(self) -> Floats:
        """Cofactor (n, m, m) of the pull of an observation that is used, without what is considered."""
        return self.weight[:, None, None] * np.eye(self.hat.shape[1]) - self.hat

    @property
    def outside(self) -> Floats:
        """Cofactor (n, m, m) of the pull of an observation that is not used, likewise."""
        return self.weight[:, None, None] * np.eye(self.hat.shape[1]) + self.hat


def equations_at(group: ObservationGroup, state: State, linearization: State) -> Linearization:
    """Misclosures at a state, with the derivatives of that of the cofactors, so that both cancel in I − H."""
    equations = group.linearize(state)
    if linearization is state:
        return equations
    return replace(group.linearize(linearization), misclosure=equations.misclosure)


def single_errors(
    group: ObservationGroup,
    equations: Linearization,
    layout: ParameterLayout,
    cofactor: Cofactor,
    taking_part: Bools | None = None,
) -> SingleErrors:
    """Errors of single observations of a group.

    Parameters
    ----------
    equations : as of :func:`equations_at`, not whitened.
    taking_part : (n,) observations in the adjustment that the cofactors belong to; None: those the group has.
    """
    alone = standardize(group, equations)
    over_time, neighbours = group.stochastic.over_time, group.stochastic.neighbours
    if over_time is None or neighbours is None:
        hat = hat_matrices(alone, alone, layout, cofactor)
        return SingleErrors(-alone.misclosure, hat, hat, np.ones(len(hat)), _considered(alone, cofactor))
    if taking_part is not None:
        neighbours = over_time.neighbours(taking_part)
    pulled = alone.combined(neighbours, neighbours.weights)
    return SingleErrors(
        -pulled.misclosure,
        hat_matrices(pulled, pulled, layout, cofactor),
        hat_matrices(alone, pulled, layout, cofactor),
        neighbours.weights.own,
        _considered(pulled, cofactor),
    )


def _considered(equations: Linearization, cofactor: Cofactor) -> Floats:
    """What errors of considered parameters add (n, m, m)."""
    if cofactor.considered is None:
        n, m = equations.misclosure.shape
        return np.zeros((n, m, m))
    return cofactor.considered.covariance_of_residuals(equations)


def hat_matrices(
    equations: Linearization, others: Linearization, layout: ParameterLayout, cofactor: Cofactor
) -> Floats:
    """A Q Bᵀ (n, m, m) between the rows of each observation in one set of equations and in another."""
    reduced = cofactor.reduced
    of_border, of_exposures, of_points = _by_kind(equations, layout, len(reduced.corner))
    same = others is equations
    other_border, other_exposures, other_points = (
        (of_border, of_exposures, of_points) if same else _by_kind(others, layout, len(reduced.corner))
    )
    if of_points:
        return _hat_of_points(of_points, other_points, cofactor)
    transposed = np.swapaxes(other_border, 1, 2)
    hat: Floats = of_border @ reduced.corner @ transposed
    for image, jacobian in of_exposures:
        hat = hat + jacobian @ reduced.border[image] @ transposed
        for other, its in other_exposures:
            hat = hat + jacobian @ reduced.between(image, other) @ np.swapaxes(its, 1, 2)
    for other, its in other_exposures:
        hat = hat + of_border @ np.swapaxes(its @ reduced.border[other], 1, 2)
    return hat


def _hat_of_points(
    of_points: list[tuple[Ints, Floats]], others: list[tuple[Ints, Floats]], cofactor: Cofactor
) -> Floats:
    """A Q Bᵀ (n, m, m) of rows that touch one object point each, or join two."""
    hat: Floats = np.zeros((1, 1, 1))
    for (point, jacobian), (_, other) in zip(of_points, others, strict=True):
        hat = hat + jacobian @ cofactor.of_points[point] @ np.swapaxes(other, 1, 2)
    if len(of_points) == 2:
        (one, first), (two, second) = of_points
        between = cofactor.between_joined(one, two)
        mixed = first @ between @ np.swapaxes(others[1][1], 1, 2)
        hat = hat + mixed + second @ np.swapaxes(others[0][1] @ between, 1, 2)
    return hat


def _by_kind(
    equations: Linearization, layout: ParameterLayout, border: int
) -> tuple[Floats, list[tuple[Ints, Floats]], list[tuple[Ints, Floats]]]:
    """Jacobians (n, m, g) of the border, those of exposures and of object points with their indices."""
    n, m = equations.misclosure.shape
    of_border = np.zeros((n, m, border))
    of_exposures, of_points = list[tuple[Ints, Floats]](), list[tuple[Ints, Floats]]()
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposures.append((term.index, term.jacobian))
        elif term.block == OBJECT_POINT:
            of_points.append((term.index, term.jacobian))
        else:
            add_border_columns(of_border, layout.columns[term.block][term.index], term.jacobian)
    return of_border, of_exposures, of_points
