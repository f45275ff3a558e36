"""The system parameters of an adjusted block as one small linear problem.

With exposures and object points eliminated there remain, for the changes a of the parameters against
their given values, N a = h with the cofactor matrix Q = N⁻¹. To drop parameter d is to hold it at its given
value; nothing has to be adjusted again (Mikhail 1976, ch. 11; the sweep of Beaton 1964):

    a ← a − Q_·d a_d / q_dd,   Q ← Q − Q_·d Q_d· / q_dd,   Ω ← Ω + a_d² / q_dd,   f ← f + 1.

To take d back is to border Q: with n = N_dd − N_dF Q N_Fd and r = h_d − N_dF a over the free parameters F

    a_d = r / n,   a_F ← a_F − Q N_Fd a_d,   q_dd = 1 / n,   Ω ← Ω − r² / n,   f ← f − 1.

A pseudo-observation belongs to its parameter and goes and comes with it. Were it left behind, it would say
that the given value equals the given value: a residual of zero that counts as redundancy and makes
σ0 look better. So with one, f does not change, and its share of Ω goes, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats

#: Part of its reduced normal S_dd that must be left of a parameter in addition to the free ones: less is
# rounding.
SINGULAR = 1e-10


@dataclass(frozen=True, eq=False)
class ParameterNormals:
    """Normal equations of the g system parameters, everything else eliminated.

    Units are those of the parameters; changes count from the given values.

    Attributes
    ----------
    names : of the parameters, as they are told to people.
    normal : (g, g) N, with the pseudo-observations; may be singular.
    rhs : (g,) h = N times the changes that all parameters together would have.
    reduced_diagonal : (g,) diagonal S_ii of the reduced system: only object points eliminated.
    prior_sigma : (g,) standard deviation of the pseudo-observation; NaN where there is none.
    prior_change : (g,) pseudo-observed minus given value, mostly 0.
    weighted_squares : Ω with all parameters at their given values and without pseudo-observations.
    redundancy : f of the same.
    """

    names: tuple[str, ...]
    normal: Floats
    rhs: Floats
    reduced_diagonal: Floats
    prior_sigma: Floats
    prior_change: Floats
    weighted_squares: float
    redundancy: int

    @property
    def has_prior(self) -> Bools:
        """(g,) whether a pseudo-observation belongs to the parameter."""
        return np.isfinite(self.prior_sigma)

    @property
    def prior_squares(self) -> Floats:
        """(g,) what the pseudo-observation adds to Ω while its parameter keeps the given value."""
        has_prior = self.has_prior
        sigma = np.where(has_prior, self.prior_sigma, 1.0)
        return np.where(has_prior, (self.prior_change / sigma) ** 2, 0.0)


@dataclass(frozen=True, eq=False)
class LinearEstimate:
    """The solution with some of the parameters free and the others at their given values.

    Attributes
    ----------
    normals : of all parameters.
    free : (g,) which are estimated.
    change : (g,) a: estimated minus given value; 0 where held.
    cofactor : (g, g) Q, marginal; zero rows and columns where held.
    weighted_squares : Ω = vᵀPv.
    redundancy : f = n − u.
    """

    normals: ParameterNormals
    free: Bools
    change: Floats
    cofactor: Floats
    weighted_squares: float
    redundancy: int

    @classmethod
    def held(cls, normals: ParameterNormals) -> LinearEstimate:
        """Every parameter at its given value."""
        g = len(normals.names)
        return cls(
            normals,
            np.zeros(g, dtype=bool),
            np.zeros(g),
            np.zeros((g, g)),
            normals.weighted_squares,
            normals.redundancy,
        )

    @classmethod
    def of(cls, normals: ParameterNormals, last: Bools | None = None) -> LinearEstimate:
        """As many parameters free as are determined, taken in one after the other.

        Parameters
        ----------
        last : (g,) those taken in after all others, so that they are the ones left out where they
            cannot be separated from the others. In order of their own part, the best first.
        """
        estimate = cls.held(normals)
        behind = np.zeros(len(normals.names), dtype=bool) if last is None else last
        for turn in (~behind, behind):
            waiting = turn.copy()
            while waiting.any():
                part = np.where(waiting, estimate.determined_part(), -1.0)
                d = int(np.argmax(part))
                if part[d] <= SINGULAR:
                    break
                estimate, waiting[d] = estimate.with_free(d), False
        return estimate

    @property
    def sigma0(self) -> float:
        """√(Ω / f); 1 without redundancy."""
        return float(np.sqrt(self.weighted_squares / self.redundancy)) if self.redundancy > 0 else 1.0

    def entering(self) -> tuple[Floats, Floats]:
        """Normal n and right-hand side r (g,) with which each held parameter would enter; 0 where free."""
        among = self.normals.normal[:, self.free]
        gain = among @ self.cofactor[np.ix_(self.free, self.free)]
        pivot = np.diagonal(self.normals.normal) - np.einsum("ij,ij->i", gain, among)
        rest = self.normals.rhs - among @ self.change[self.free]
        return np.where(self.free, 0.0, pivot), np.where(self.free, 0.0, rest)

    def determined_part(self) -> Floats:
        """(g,) n / S_dd: what is left of a held parameter's own observations besides all that is free."""
        pivot, _ = self.entering()
        diagonal = self.normals.reduced_diagonal
        return np.where(diagonal > 0.0, pivot / np.where(diagonal > 0.0, diagonal, 1.0), 0.0)

    def without(self, d: int) -> LinearEstimate:
        """Parameter d dropped: back at its given value, with its pseudo-observation."""
        if not self.free[d]:
            raise ValueError(f"{self.normals.names[d]} is already held")
        column, own = self.cofactor[:, d], self.cofactor[d, d]
        cofactor = self.cofactor - np.outer(column, column) / own
        change = self.change - column * (self.change[d] / own)
        # What is zero in theory is zero.
        cofactor[d, :] = cofactor[:, d] = change[d] = 0.0
        free = self.free.copy()
        free[d] = False
        squares = self.weighted_squares + self.change[d] ** 2 / own - self.normals.prior_squares[d]
        redundancy = self.redundancy + 1 - int(self.normals.has_prior[d])
        return replace(
            self,
            free=free,
            change=change,
            cofactor=cofactor,
            weighted_squares=float(squares),
            redundancy=redundancy,
        )

    def with_free(self, d: int) -> LinearEstimate:
        """Parameter d taken (back) in, with its pseudo-observation.

        Raises
        ------
        ValueError : if it is already free, or not determined together with the others.
        """
        name = self.normals.names[d]
        if self.free[d]:
            raise ValueError(f"{name} is already free")
        if self.determined_part()[d] <= SINGULAR:
            raise ValueError(f"{name} is not determined together with the free parameters")
        pivot, rest = self.entering()
        gain = self.cofactor @ self.normals.normal[:, d]
        cofactor = self.cofactor + np.outer(gain, gain) / pivot[d]
        cofactor[d, :] = cofactor[:, d] = -gain / pivot[d]
        cofactor[d, d] = 1.0 / pivot[d]
        own = rest[d] / pivot[d]
        change = self.change - gain * own
        change[d] = own
        free = self.free.copy()
        free[d] = True
        squares = self.weighted_squares + self.normals.prior_squares[d] - rest[d] ** 2 / pivot[d]
        redundancy = self.redundancy - 1 + int(self.normals.has_prior[d])
        return replace(
            self,
            free=free,
            change=change,
            cofactor=cofactor,
            weighted_squares=float(squares),
            redundancy=redundancy,
        )
