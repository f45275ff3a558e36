"""Linear problems small enough to be solved in full each time, as the truth about the exact updates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.selection.linear_estimate import ParameterNormals


@dataclass(frozen=True, eq=False)
class Design:
    """Observations of g parameters and of others that are always unknown, unit weights.

    ``of_parameters`` (n, g), ``of_others`` (n, k), ``observed`` (n,), ``prior_sigma`` (g,) NaN for none,
    ``prior_change`` (g,).
    """

    of_parameters: Floats
    of_others: Floats
    observed: Floats
    prior_sigma: Floats
    prior_change: Floats

    @property
    def normals(self) -> ParameterNormals:
        """As the adjustment would hand them over."""
        a, b = self.of_parameters, self.of_others
        without_others = np.eye(len(a)) - b @ np.linalg.pinv(b)
        rest = without_others @ self.observed
        weight = np.where(np.isfinite(self.prior_sigma), 1.0 / self.prior_sigma**2, 0.0)
        return ParameterNormals(
            tuple(f"p{k}" for k in range(a.shape[1])),
            a.T @ without_others @ a + np.diag(weight),
            a.T @ rest + weight * self.prior_change,
            np.diagonal(a.T @ a) + weight,
            self.prior_sigma,
            self.prior_change,
            float(rest @ rest),
            len(a) - b.shape[1],
        )

    def solved(self, free: Bools) -> tuple[Floats, Floats, float, int]:
        """Changes (g,), cofactors (g, g), Ω and f of an ordinary adjustment with these parameters free."""
        g = self.of_parameters.shape[1]
        kept = np.flatnonzero(free)
        observed = kept[np.isfinite(self.prior_sigma[kept])]
        rows = np.zeros((len(observed), len(kept)))
        rows[np.arange(len(observed)), np.searchsorted(kept, observed)] = 1.0 / self.prior_sigma[observed]
        matrix = np.block(
            [
                [self.of_parameters[:, kept], self.of_others],
                [rows, np.zeros((len(observed), self.of_others.shape[1]))],
            ]
        )
        given = np.concatenate([self.observed, self.prior_change[observed] / self.prior_sigma[observed]])
        # Columns of length 1: the units of the parameters must not cost the reference its digits.
        length = np.linalg.norm(matrix, axis=0)
        matrix = matrix / length
        solution, *_ = np.linalg.lstsq(matrix, given)
        change, cofactor = np.zeros(g), np.zeros((g, g))
        change[kept] = (solution / length)[: len(kept)]
        inverse = np.linalg.inv(matrix.T @ matrix) / np.outer(length, length)
        cofactor[np.ix_(kept, kept)] = inverse[: len(kept), : len(kept)]
        residual = matrix @ solution - given
        return change, cofactor, float(residual @ residual), matrix.shape[0] - matrix.shape[1]


def random_design(
    seed: int, parameters: int = 8, others: int = 3, observations: int = 60, priors: bool = True
) -> Design:
    """Correlated parameters in units from 10⁻⁴ to 10⁴, every other one with a pseudo-observation off zero."""
    generator = np.random.default_rng(seed)
    unit = 10.0 ** generator.uniform(-4, 4, parameters)
    matrix = generator.normal(size=(observations, parameters)) + generator.normal(size=(observations, 1))
    others_matrix = generator.normal(size=(observations, others)) + 0.5 * matrix[:, :others]
    prior = np.where(np.arange(parameters) % 2 == 0, generator.uniform(0.05, 0.5, parameters), np.nan)
    offset = np.where(np.isfinite(prior), 0.3 * prior * generator.normal(size=parameters), 0.0)
    if not priors:
        prior, offset = np.full(parameters, np.nan), np.zeros(parameters)
    observed = matrix @ generator.normal(size=parameters) + generator.normal(size=observations)
    return Design(matrix / unit, others_matrix, observed, prior * unit, offset * unit)
