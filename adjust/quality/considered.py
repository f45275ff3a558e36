"""Considered parameters: what the errors of held values add to the covariances of everything else.

The estimate is that of an adjustment in which the parameters g are held. Their values have errors with the
covariance C = R Rᵀ, so that the unknowns are wrong by −K δ, K = N⁻¹ A_xᵀ A_g, and the residuals by B̃ δ:

    Cov(x) = σ0² N⁻¹ + K C Kᵀ,    Cov(x, g) = −K C,    B̃ = A_g − A_x K,    Q_vv = (I − H) + B̃ C B̃ᵀ

(Schmidt 1966). K R takes one solution with the factors that are there for each parameter, so nothing of the
solver changes. The redundancy numbers are those of the adjustment with g held; σ0 scales N⁻¹ alone. With the
reduced normal equations S̃ g = s̃ of the parameters, all else eliminated, a block that agrees with them has

    T = s̃ᵀ (σ0² S̃ + S̃ C S̃)⁺ s̃ ~ χ²,    with the rank of S̃ as degrees of freedom.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.observations.joint_prior import JointPrior
from adjust.parameters import ParameterLayout, State
from adjust.quality.alternative_products import products_of
from adjust.quality.cofactor import Cofactor
from adjust.quality.considered_errors import ConsideredErrors, Contradiction
from adjust.quality.detectability import INDISTINGUISHABLE
from adjust.quality.model_alternatives import considered_alternatives
from adjust.quality.single_error import single_errors
from adjust.quality.unknown_errors import errors_of_families, in_datum
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System

# So many blocks or image points at a time bound the memory of what is between.
_AT_ONCE = 65_536


def contradiction_of_prior(
    group: JointPrior, state: State, layout: ParameterLayout, quality: Cofactor, sigma0: float = 1.0
) -> Contradiction:
    """The same test where the parameters are observed with their covariance in place of being considered.

    What the block says of the parameters has the covariance σ0² S̃⁻¹, the given values C, which no σ0
    scales. Along the eigenvectors of I − H, with S̃ = λ/(1 − λ) for C = 1, residuals have the variances
    λ (σ0² (1 − λ) + λ), and errors of other parameters that are considered add their own.
    """
    found = single_errors(group, group.linearize(state), layout, quality)
    values, vectors = np.linalg.eigh(found.inside[0])
    told = values > INDISTINGUISHABLE
    values, vectors = values[told], vectors[:, told]
    along = vectors.T @ found.pull[0]
    spread = np.diag(values * (sigma0**2 * (1.0 - values) + values))
    spread += vectors.T @ found.considered[0] @ vectors
    return Contradiction(float(along @ np.linalg.solve(spread, along)), len(values))


def considered_errors(system: System, solution: Solution) -> ConsideredErrors | None:
    """Effects of the errors of the considered parameters of a block at its solution; None without any."""
    known = system.block.considered
    if known is None:
        return None
    products = products_of(system, solution.linearization, considered_alternatives(known))
    load = products.load.full(system.active_point)
    solved = solve_full(system, solution.linearization, solution.factorization, load)
    left = products.own - load.dot(solved)
    k = len(known.places)
    onto_errors = np.vstack([-known.root, np.zeros((1, k))])
    of_unknowns = in_datum(solution, system.layout, solved.times(onto_errors))
    of_families = errors_of_families(system.layout, of_unknowns.of_border)
    for place, own in zip(known.places, known.root, strict=True):
        of_families[place.family][place.entity, place.component] = own
    return ConsideredErrors(
        of_unknowns,
        of_families,
        known,
        solution.linearization,
        0.5 * (left[:k, :k] + left[:k, :k].T),
        products.own[:k, :k],
        left[:k, k],
    )


def with_considered(quality: Cofactor, sigma0: float) -> Cofactor:
    """Cofactors which, times σ0², are covariances with the errors of considered parameters in them.

    Those of corrections of image coordinates are in them, too.
    The hat matrices stay, as do the normal equations of the system parameters: both are of the adjustment.
    """
    given = quality.errors_of_unknowns
    if given is None:
        return quality
    errors = given.times(np.eye(given.count) / sigma0)
    of_points = quality.of_points + errors.of_points @ np.swapaxes(errors.of_points, 1, 2)
    return replace(quality, reduced=_reduced(quality.reduced, errors), of_points=of_points)


def _reduced(given: ReducedCofactor, errors: FullVectors) -> ReducedCofactor:
    """Blocks of exposures and system parameters."""
    row, column = given.pattern.row, given.pattern.column
    of_exposures, of_border = errors.of_exposures, errors.of_border
    blocks = np.empty_like(given.blocks)
    for first in range(0, len(blocks), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        added = of_exposures[row[part]] @ np.swapaxes(of_exposures[column[part]], 1, 2)
        blocks[part] = given.blocks[part] + added
    return replace(
        given,
        blocks=blocks,
        border=given.border + of_exposures @ of_border.T,
        corner=given.corner + of_border @ of_border.T,
    )
