"""Errors of considered parameters in what is adjusted, and the test whether a block contradicts them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.observations.base import Linearization, ObservationGroup
from adjust.observations.image_point import ImagePoints
from adjust.parameters import ConsideredParameters, State
from adjust.quality.detectability import INDISTINGUISHABLE
from adjust.quality.unknown_errors import UnknownErrors
from adjust.solve.whitening import standardize, whiten

# So many image points at a time bound the memory of what is between.
_AT_ONCE = 65_536


@dataclass(frozen=True)
class Contradiction:
    """Test whether a block contradicts what is known of parameters.

    Attributes
    ----------
    statistic : T, distributed as χ² if it does not.
    freedom : its degrees of freedom: what the block says of the parameters at all.
    """

    statistic: float
    freedom: int

    @property
    def probability(self) -> float:
        """How often T is larger although nothing is wrong; 1 without freedom."""
        return float(special.chdtrc(self.freedom, self.statistic)) if self.freedom else 1.0


@dataclass(frozen=True, eq=False)
class ConsideredErrors(UnknownErrors):
    """What k independent errors of unit variance in the considered parameters change.

    Attributes
    ----------
    known : the parameters and their covariance. ``of_unknowns`` is −K R, ``of_computed`` B̃ R.
    state : that of linearisation: derivatives at another one would not cancel in B̃.
    information, own : (k, k) S̃, and the same with nothing else unknown, A_gᵀ A_g.
    score : (k,) s̃.
    """

    known: ConsideredParameters
    state: State
    information: Floats
    own: Floats
    score: Floats

    @cached_property
    def most_probable(self) -> Floats:
        """The k errors for which the residuals speak, with their unit variances: (1 + RᵀS̃R)⁻¹ Rᵀ B̃ᵀ P v."""
        return np.asarray(self.remaining_root @ self.remaining_root.T @ self._evidence)

    @cached_property
    def remaining_root(self) -> Floats:
        """(k, k) root of their covariance after that, (1 + RᵀS̃R)⁻¹."""
        inverse = np.linalg.inv(np.linalg.cholesky(np.eye(len(self._evidence)) + self._information_of_errors))
        return np.asarray(inverse.T)

    @property
    def _evidence(self) -> Floats:
        """Rᵀ B̃ᵀ P v (k,) of the residuals v, adjusted − observed, which the score has as misclosures."""
        return np.asarray(-self.known.root.T @ self.score)

    @property
    def _information_of_errors(self) -> Floats:
        return np.asarray(self.known.root.T @ self.information @ self.known.root)

    def left(self, weighted_squares: float, redundancy: float) -> tuple[float, float]:
        """What the most probable errors leave of vᵀPv and n − u of all observations."""
        errors, information = self.most_probable, self._information_of_errors
        squares = weighted_squares - 2.0 * errors @ self._evidence + errors @ information @ errors
        return float(squares), redundancy - float(
            np.sum((information @ self.remaining_root) * self.remaining_root)
        )

    def of_whitened(self, group: ObservationGroup) -> Floats:
        """Errors (n, m, k) of the whitened residuals of a group, without a unit: B̃ R."""
        if not isinstance(group, ImagePoints):
            return self.of_computed(whiten(group, group.linearize(self.state)))
        errors = np.empty((len(group.image), 2, self.of_unknowns.count))
        for first in range(0, len(errors), _AT_ONCE):
            part = group.only(slice(first, first + _AT_ONCE))
            errors[first : first + _AT_ONCE] = self.of_computed(standardize(part, part.linearize(self.state)))
        return errors

    def covariance_of_residuals(self, equations: Linearization) -> Floats:
        """B̃ C B̃ᵀ (n, m, m) of every observation."""
        errors = self.of_computed(equations)
        return errors @ np.swapaxes(errors, 1, 2)

    def covariance_of_rays(self, rays: ImagePoints) -> Floats:
        """The same (n, 2, 2) of image points in units of their σ; zero for those that are not used."""
        covariance = np.empty((len(rays.image), 2, 2))
        for first in range(0, len(covariance), _AT_ONCE):
            part = rays.only(slice(first, first + _AT_ONCE))
            equations = standardize(part, part.linearize(self.state))
            covariance[first : first + _AT_ONCE] = self.covariance_of_residuals(equations)
        return covariance

    def contradiction(self, members: Sequence[int], sigma0: float = 1.0) -> Contradiction:
        """Whether the block contradicts the values of some of the parameters, by their numbers."""
        chosen = list(members)
        # In units of the σ, compared with the others' errors.
        sigma = np.sqrt(np.diagonal(self.known.covariance)[chosen])
        normal, own = (
            sigma[:, None] * matrix[np.ix_(chosen, chosen)] * sigma for matrix in (self.information, self.own)
        )
        moved = sigma[:, None] * self.information[chosen] @ self.known.root
        scale = 1.0 / np.sqrt(np.where(np.diagonal(own) > 0.0, np.diagonal(own), 1.0))
        values, vectors = np.linalg.eigh(scale[:, None] * normal * scale)
        told = (scale[:, None] * vectors)[:, values > INDISTINGUISHABLE]
        score, effect = told.T @ (sigma * self.score[chosen]), told.T @ moved
        spread = sigma0**2 * told.T @ normal @ told + effect @ effect.T
        return Contradiction(float(score @ np.linalg.solve(spread, score)), told.shape[1])
