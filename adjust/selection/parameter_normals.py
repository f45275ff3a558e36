"""From a block to the normal equations of its system parameters.

Around a state with the changes a₀ and the right-hand side s (zero where the block is adjusted)

    Ω(a) = Ω(a₀) − 2 sᵀ(a − a₀) + (a − a₀)ᵀ N (a − a₀),   h = N a₀ + s,

with exposures and object points always at their best.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.observations.base import ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.parameters import ParameterLayout, State
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.selection.linear_estimate import ParameterNormals
from adjust.solve.defect import explain_defect
from adjust.solve.factorization import SingularNormalsError, factorize
from adjust.solve.free_network import open_movements
from adjust.solve.gauss_newton import Solution
from adjust.solve.helmert_blocking import HelmertFactor
from adjust.solve.normal_equations import ReducedNormals, reduced_normals, substitute_back
from adjust.solve.system import System


def normals_of_result(result: AdjustmentResult) -> ParameterNormals:
    """Normal equations of the system parameters that were free in an adjustment."""
    layout = result.layout
    used = (ObservationStatus.USED, ObservationStatus.UNCONTROLLED)
    direct = [
        item.group.without(np.asarray(~np.isin(item.status, used).any(axis=1)))
        for item in result.groups
        if isinstance(item.group, DirectObservations)
    ]
    return _normals(
        layout,
        result.state,
        result.cofactor.reduced.normal,
        np.zeros(layout.border),
        result.cofactor.reduced.reduced_diagonal,
        tuple(direct),
        result.test.weighted_squares,
        result.test.redundancy,
    )


def normals_of_solution(system: System, solution: Solution) -> ParameterNormals:
    """The same before anything else is known of the adjustment; not of a network with an open datum."""
    g, normals = system.layout.border, solution.normals
    return _normals(
        system.layout,
        solution.state,
        _normal(system, solution),
        np.zeros(g),
        normals.diagonal_of_parameters,
        system.observations.others,
        normals.weighted_squares,
        system.redundancy,
    )


def state_with(system: System, solution: Solution, increments: Floats) -> State:
    """The solution with other system parameters, everything else where linear equations see it best then.

    Parameters
    ----------
    increments : (g,) of the parameters against the solution, in their units; not of an open datum.
    """
    normals, factor = solution.normals, solution.factorization.factor
    load = np.zeros(system.border)
    load[: system.layout.border] = _normal(system, solution) @ increments
    of_exposures, of_border = factor.solve(np.zeros_like(normals.rhs_exposure), load)
    without_load = replace(normals, point_rhs=np.zeros_like(normals.point_rhs))
    of_points = substitute_back(system, solution.linearization, without_load, of_exposures, of_border)
    return system.layout.update(solution.state, of_exposures, of_border, of_points)


def _normal(system: System, solution: Solution) -> Floats:
    """N (g, g) of the system parameters with everything else eliminated, joins of object points, too."""
    g, normal = system.layout.border, solution.factorization.factor.border_normal()
    mixed, joins = normal[:g, g:], normal[g:, g:]
    return np.asarray(normal[:g, :g] - mixed @ np.linalg.solve(joins, mixed.T))


def changes_from_given(layout: ParameterLayout, state: State) -> Floats:
    """(g,) values of the system parameters of a state less their given values."""
    change = np.zeros(layout.border)
    for parameters in layout.system:
        columns = layout.columns[parameters.family.name]
        free = columns >= 0
        change[columns[free]] = (state.system[parameters.family.name] - parameters.values)[free]
    return change


def normals_at(system: System, state: State) -> ParameterNormals:
    """Normal equations of the free system parameters of a system, linearised at a given state.

    Works also where the block does not determine them all: adjust it with those in question held and
    take its state. What is not determined is then left out by :meth:`LinearEstimate.of`, by name.

    Raises
    ------
    DatumDefectError : if not even the exposures are determined while all system parameters are held.
    """
    normals = reduced_normals(system, state)
    layout, g = system.layout, system.layout.border
    factor, defect = _exposures_alone(system, state, normals)
    of_rhs, _ = factor.solve(normals.rhs_exposure, np.zeros(0))
    normal = normals.corner.copy()
    for column in range(system.border):
        solved, _ = factor.solve(np.ascontiguousarray(normals.border[:, :, column]), np.zeros(0))
        normal[:, column] -= np.einsum("nig,ni->g", normals.border, solved)
    rhs = normals.rhs_border - np.einsum("nig,ni->g", normals.border, of_rhs)
    squares = normals.weighted_squares - normals.eliminated - float(np.sum(normals.rhs_exposure * of_rhs))
    if system.border > g:
        joins = np.linalg.solve(normal[g:, g:], np.column_stack([normal[g:, :g], rhs[g:]]))
        squares -= float(rhs[g:] @ joins[:, g])
        rhs = rhs[:g] - normal[:g, g:] @ joins[:, g]
        normal = normal[:g, :g] - normal[:g, g:] @ joins[:, :g]
    return _normals(
        layout,
        state,
        0.5 * (normal + normal.T),
        rhs,
        normals.diagonal_of_parameters,
        system.observations.others,
        squares,
        system.redundancy + defect,
    )


def _exposures_alone(system: System, state: State, normals: ReducedNormals) -> tuple[HelmertFactor, int]:
    """The reduced system factorised with all system parameters held, and the number of open movements."""
    n, g = normals.pattern.events, len(normals.rhs_border)
    alone = replace(
        normals,
        border=np.zeros((n, 6, 0)),
        corner=np.zeros((0, 0)),
        rhs_border=np.zeros(0),
        diagonal_border=np.zeros(0),
    )
    held = tuple(replace(item, free=np.zeros_like(item.free)) for item in system.layout.system)
    layout = ParameterLayout(system.layout.events, system.layout.points, held)
    movements = open_movements(replace(system, layout=layout), state, alone)
    try:
        if movements is None:
            return factorize(alone, system.threads).factor, 0
        return factorize(movements.held(alone), system.threads).factor, movements.defect
    except SingularNormalsError as error:
        defect = error.null_space.shape[1]
        null_space = np.concatenate([error.null_space, np.zeros((g, defect))])
        scale = np.concatenate([error.scale, np.ones(g)])
        raise explain_defect(system, state, SingularNormalsError(null_space, scale)) from error


def _normals(
    layout: ParameterLayout,
    state: State,
    normal: Floats,
    rhs: Floats,
    reduced_diagonal: Floats,
    groups: tuple[ObservationGroup, ...],
    weighted_squares: float,
    redundancy: int,
) -> ParameterNormals:
    """Referred to the given values.

    Parameters
    ----------
    rhs : (g,) s at the state.
    weighted_squares, redundancy : Ω(a₀) and f with all parameters free.
    """
    change, names = changes_from_given(layout, state), _names(layout)
    sigma, observed = np.full(layout.border, np.nan), np.zeros(layout.border)
    for parameters in layout.system:
        columns = layout.columns[parameters.family.name]
        for group in groups:
            if not isinstance(group, DirectObservations) or group.family.name != parameters.family.name:
                continue
            own = columns[group.entity]
            used = (own >= 0) & group.stochastic.present
            sigma[own[used]] = group.stochastic.sigma[used]
            observed[own[used]] = (group.given - parameters.values[group.entity])[used]
    squares = weighted_squares + 2.0 * float(rhs @ change) + float(change @ normal @ change)
    found = ParameterNormals(
        names,
        normal,
        normal @ change + rhs,
        reduced_diagonal,
        sigma,
        observed,
        squares,
        redundancy + layout.border,
    )
    return replace(
        found,
        weighted_squares=squares - float(found.prior_squares.sum()),
        redundancy=found.redundancy - int(found.has_prior.sum()),
    )


def _names(layout: ParameterLayout) -> tuple[str, ...]:
    """Names of the columns; with their entity where the parameter occurs more than once."""
    names = layout.border_names()
    parameters = [parameter for parameter, _, _ in names]
    return tuple(
        parameter if parameters.count(parameter) == 1 else f"{parameter} of {entity}"
        for parameter, entity, _ in names
    )
