"""Parts of every observation group: a functional model and a separate stochastic model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self, runtime_checkable

import numpy as np

from adjust.arrays import Bools, Floats, Ints, as_indices, require_shape
from adjust.errors import InconsistentBlockError
from adjust.observations.gauss_markov import GaussMarkov, Neighbours, Stencil
from adjust.parameters import State, Unit


@dataclass(frozen=True, eq=False)
class Term:
    """Partial derivatives of the observations of a group with respect to one kind of unknown.

    Attributes
    ----------
    block : "exterior_orientation", "object_point" or the name of a family of system parameters.
    index : (n,) which event, point or entity each observation touches.
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

    def combined(self, neighbours: Neighbours, stencil: Stencil) -> Linearization:
        """Every observation with multiples of those before and after it in its strip.

        Each term is followed by those of the neighbours with a coefficient, in the places of their unknowns.
        """
        terms = list[Term]()
        for term in self.terms:
            for coefficient, source in (
                (stencil.own, slice(None)),
                (stencil.before, neighbours.before),
                (stencil.after, neighbours.after),
            ):
                if coefficient.any():
                    jacobian = coefficient[:, None, None] * term.jacobian[source]
                    terms.append(Term(term.block, term.index[source], jacobian))
        return Linearization(neighbours.combined(stencil, self.misclosure), tuple(terms))


@dataclass(frozen=True, eq=False)
class StochasticModel:
    """Weights of n observations with m components each.

    Components of one observation may be correlated. Different observations are not, unless their errors
    are a Gauss–Markov process over time: then W e of each observation by itself, its *standardized* errors,
    have the correlations of that process, component by component.

    Attributes
    ----------
    whitener : (n, m, m) W with Wᵀ W = P, the weight matrix of each observation by itself (a-priori σ0 = 1).
        Rows and columns of absent components are zero.
    present : (n, m) which components were observed and are used.
    sigma : (n, m) a-priori standard deviations; NaN where never observed.
    over_time : how the errors are correlated over time; None: not at all.
    share : (n,) part of an independent observation that each is, where several are one reading, with larger σ
        for it; None: each is one.
    """

    whitener: Floats
    present: Bools
    sigma: Floats
    over_time: GaussMarkov | None = None
    share: Floats | None = None

    @classmethod
    def from_sigma(cls, sigma: Floats) -> Self:
        """Uncorrelated components with standard deviations (n, m); NaN marks an absent one.

        Raises
        ------
        InconsistentBlockError : if a standard deviation is not positive.
        """
        sigma = np.asarray(sigma, dtype=np.float64)
        if sigma.ndim != 2:
            raise InconsistentBlockError(
                f"The standard deviations have the shape {sigma.shape}; expected: observations, components."
            )
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

    @property
    def unwhitener(self) -> Floats:
        """(n, m, m) W⁻¹ on the present components, zero elsewhere; W⁻¹ W⁻ᵀ is the covariance matrix.

        That of each observation by itself, as W.
        """
        absent = np.zeros_like(self.whitener)
        diagonal = np.arange(self.present.shape[1])
        absent[:, diagonal, diagonal] = np.where(self.present, 0.0, 1.0)
        both = self.present[:, :, None] & self.present[:, None, :]
        return np.where(both, np.linalg.inv(self.whitener + absent), 0.0)

    def correlated(self, over_time: GaussMarkov) -> Self:
        """The same standard deviations with errors correlated over time.

        Raises
        ------
        InconsistentBlockError : if an observation has some of its components only.
        """
        if np.any(self.taking_part & ~self.present.all(axis=1)):
            raise InconsistentBlockError("An observation with errors correlated over time must be complete.")
        return replace(self, over_time=over_time)

    def with_correlation_time(self, seconds: float) -> Self:
        """The same model with errors that last so long; unchanged if they are not correlated over time."""
        if self.over_time is None:
            return self
        return replace(self, over_time=self.over_time.with_correlation_time(seconds))

    @cached_property
    def neighbours(self) -> Neighbours | None:
        """Order of the observations that are used in each strip; None without correlation over time."""
        return None if self.over_time is None else self.over_time.neighbours(self.taking_part)

    @cached_property
    def diagonal(self) -> Floats | None:
        """(n, m) that of W where the components of no observation are correlated; None otherwise."""
        m = self.whitener.shape[1]
        if self.whitener[:, ~np.eye(m, dtype=bool)].any():
            return None
        return np.ascontiguousarray(np.diagonal(self.whitener, axis1=1, axis2=2))

    @property
    def shares(self) -> Floats:
        """(n, 1) part of an independent observation that each is."""
        return (np.ones(len(self.sigma)) if self.share is None else self.share)[:, None]

    @property
    def taking_part(self) -> Bools:
        """(n,) whether any component of an observation is used."""
        return np.asarray(self.present.any(axis=1))

    def standardized(self, vectors: Floats) -> Floats:
        """W e (n, m) of each observation by itself."""
        if self.diagonal is not None:
            return self.diagonal * vectors
        return np.asarray(np.einsum("nij,nj->ni", self.whitener, vectors))

    def whitened(self, vectors: Floats) -> Floats:
        """Vectors (n, m) in which errors become independent with unit variance."""
        alone, neighbours = self.standardized(vectors), self.neighbours
        return alone if neighbours is None else neighbours.combined(neighbours.whitening, alone)

    def unwhitened(self, white: Floats) -> Floats:
        """Errors (n, m) whose whitened values are given; zero for what is not used."""
        alone = np.where(self.present, white, 0.0)
        if self.neighbours is not None:
            alone = self.neighbours.correlated(alone)
        return np.asarray(np.einsum("nij,nj->ni", self.unwhitener, alone))

    def weighted(self, vectors: Floats) -> Floats:
        """P e (n, m) with the weight matrix of the whole group."""
        alone, neighbours = self.standardized(vectors), self.neighbours
        if neighbours is not None:
            alone = neighbours.combined(neighbours.weights, alone)
        return np.asarray(np.einsum("nji,nj->ni", self.whitener, alone))

    def weight_diagonal(self, observations: Ints | None = None) -> Floats:
        """Diagonal (k, m) of P of some observations (k,), None: of all; zero for what is not used."""
        rows = slice(None) if observations is None else observations
        alone: Floats = np.sum(self.whitener[rows] ** 2, axis=1)
        return alone if self.neighbours is None else self.neighbours.weights.own[rows, None] * alone

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


@runtime_checkable
class ObservationGroup(Protocol):
    """A group of observations of one kind.

    Attributes
    ----------
    name : of the group, as it is reported.
    components : names of the m components, in order.
    unit : SI unit of the observations.
    event, point : (n,) index of the event and object point an observation belongs to, −1 for none.
    stochastic : the weights.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def components(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def unit(self) -> Unit: ...  # noqa: D102
    @property
    def event(self) -> Ints: ...  # noqa: D102
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


@runtime_checkable
class JoinsPoints(Protocol):
    """A group whose observations, of one number, join two object points each: ``point`` and this one.

    Its equations have one term for each of the two, and no others.
    """

    @property
    def other_point(self) -> Ints:
        """(n,) index of the second object point."""
        ...


@runtime_checkable
class CorrelatedOverTime(Protocol):
    """A group whose errors may be correlated over time."""

    def with_correlation_time(self, seconds: float) -> Self:
        """The same group with errors that last so long."""
        ...


def require_rows(group: ObservationGroup, indices: tuple[str, ...], **shapes: tuple[int, ...]) -> None:
    """Refuse a group whose arrays do not have a row for each of its n observations.

    Parameters
    ----------
    indices : names of its index arrays (n,).
    shapes : of its other arrays, by name, without their first axis.

    Raises
    ------
    InconsistentBlockError : with the array and both shapes.
    """
    n, m = len(group.stochastic.present), len(group.components)
    require_shape(f"{group.name}: the weights", group.stochastic.present.shape, (n, m))
    for name in indices:
        object.__setattr__(group, name, as_indices(f"{group.name}: {name}", getattr(group, name), n))
    for name, rest in shapes.items():
        values = np.asarray(getattr(group, name), dtype=np.float64)
        require_shape(f"{group.name}: {name}", values.shape, (n, *rest))
        object.__setattr__(group, name, values)


def require_values(group: ObservationGroup, known: Bools, what: str = "finite value") -> None:
    """Refuse an observation that takes part without a value.

    Parameters
    ----------
    known : (n, m) or (n, 1) whether there is one.
    what : such a value.

    Raises
    ------
    InconsistentBlockError : with the first one.
    """
    missing = (group.stochastic.present & ~known).any(axis=1)
    if missing.any():
        raise InconsistentBlockError(
            f"Observation {int(np.argmax(missing))} of {group.name} has a weight, but no {what}. A "
            "component that was not observed has the standard deviation NaN."
        )
