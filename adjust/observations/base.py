"""What every observation group is: a functional model and, apart from it, a stochastic model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.parameters import State, Unit


@dataclass(frozen=True, eq=False)
class Term:
    """Partial derivatives of the observations of a group with respect to one kind of unknown.

    Attributes
    ----------
    block : "exterior_orientation", "object_point" or the name of a family of system parameters.
    index : (n,) which image, point or entity each observation touches.
    jacobian : (n, m, d), m observed components, d parameters of the entity.
    """

    block: str
    index: Ints
    jacobian: Floats


@dataclass(frozen=True, eq=False)
class Linearization:
    """Observation equations v = A dx − misclosure at one state.

    Attributes
    ----------
    misclosure : (n, m) observed − computed.
    terms : the non-zero parts of A.
    """

    misclosure: Floats
    terms: tuple[Term, ...]


@dataclass(frozen=True, eq=False)
class StochasticModel:
    """Weights of n observations with m components each, correlated only within an observation.

    Attributes
    ----------
    whitener : (n, m, m) W with Wᵀ W = P, the weight matrix (a-priori σ0 = 1). Rows and columns of
        absent components are zero.
    present : (n, m) which components were observed and take part.
    sigma : (n, m) a-priori standard deviations; NaN where never observed.
    """

    whitener: Floats
    present: Bools
    sigma: Floats

    @classmethod
    def from_sigma(cls, sigma: Floats) -> Self:
        """Uncorrelated components with standard deviations (n, m); NaN marks an absent one.

        Raises
        ------
        InconsistentBlockError : if a standard deviation is not positive.
        """
        present = np.isfinite(sigma)
        if np.any(sigma[present] <= 0.0):
            raise InconsistentBlockError("A standard deviation is zero or negative.")
        whitener = np.zeros((*sigma.shape, sigma.shape[1]))
        diagonal = np.arange(sigma.shape[1])
        whitener[:, diagonal, diagonal] = np.where(present, 1.0 / np.where(present, sigma, 1.0), 0.0)
        return cls(whitener, present, np.where(present, sigma, np.nan))

    @classmethod
    def from_covariance(cls, covariance: Floats, present: Bools) -> Self:
        """Full covariance matrices (n, m, m) of the present components (n, m).

        Raises
        ------
        InconsistentBlockError : if a matrix is not positive definite.
        """
        whitener = np.zeros_like(covariance)
        for pattern in np.unique(present, axis=0):
            rows = np.flatnonzero((present == pattern).all(axis=1))
            kept = np.flatnonzero(pattern)
            if len(kept) == 0:
                continue
            part = covariance[np.ix_(rows, kept, kept)]
            try:
                lower = np.linalg.cholesky(part)
            except np.linalg.LinAlgError as error:
                raise InconsistentBlockError("A covariance matrix is not positive definite.") from error
            whitener[np.ix_(rows, kept, kept)] = np.linalg.inv(lower)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        with np.errstate(invalid="ignore"):
            sigma = np.where(present, np.sqrt(variance), np.nan)
        return cls(whitener, present, sigma)

    def without(self, rejected: Bools) -> Self:
        """The same model with the observations (n,) that are rejected taken out."""
        whitener = np.where(rejected[:, None, None], 0.0, self.whitener)
        return replace(self, whitener=whitener, present=self.present & ~rejected[:, None])

    def rescaled(self, factor: Floats) -> Self:
        """The same model with its standard deviations multiplied by factors that broadcast to (n, m).

        Correlations are kept: Σ becomes F Σ F with F = diag(factors), so W becomes W F⁻¹.
        """
        return replace(
            self,
            whitener=self.whitener / np.broadcast_to(factor, self.sigma.shape)[:, None, :],
            sigma=self.sigma * factor,
        )


class ObservationGroup(Protocol):
    """A group of observations of one kind.

    Attributes
    ----------
    name : of the group, as it is reported.
    components : names of the m components, in order.
    unit : SI unit of the observations.
    image, point : (n,) index of the image and object point an observation belongs to, −1 for none.
    stochastic : the weights.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def components(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def unit(self) -> Unit: ...  # noqa: D102
    @property
    def image(self) -> Ints: ...  # noqa: D102
    @property
    def point(self) -> Ints: ...  # noqa: D102
    @property
    def stochastic(self) -> StochasticModel: ...  # noqa: D102

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state."""
        ...

    def without(self, rejected: Bools) -> Self:
        """The same group with the observations (n,) that are rejected taken out."""
        ...

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        ...
