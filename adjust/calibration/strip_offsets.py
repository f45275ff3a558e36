"""What the strips say about lever arm, shift and boresight: linear models of their means, and nested tests.

    d_k = s_f + R(ψ_k) l_m + e_k      offset of strip k in plan that the given lever arm leaves
    θ_k = b_m + e_k                   misalignment of strip k

s_f is fixed in the map (a shift of flight f), l_m in the aircraft (a lever arm of mounting m); only different
headings tell them apart. Heights are left out: there a shift is a lever arm in every heading. The scatter
of the strips gives the standard deviations, so that a model and a smaller one that it contains are compared
by the F-test: ((Ω_small − Ω) / q) / (Ω / f) with q more unknowns and f degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints

# Singular values below this part of the largest, columns of one length, are zero: two headings that differ by
# less than 4.6° separate nothing.
_RANK = 0.02
# Squares of residuals below this part of those of the values are rounding.
_ROUNDING = 1e-18


@dataclass(frozen=True, slots=True)
class NestedTest:
    """Test of a model against a smaller model that it contains.

    Attributes
    ----------
    chi_squared : decrease of the squares of the residuals over the variance of a strip; NaN: not testable.
    freedom : more unknowns that the strips can tell from the others; 0: none, nothing is tested.
    variance_freedom : degrees of freedom of the variance of a strip.
    probability : of a decrease as large by chance (F-test); NaN: not testable.
    """

    chi_squared: float
    freedom: int
    variance_freedom: int
    probability: float

    @property
    def testable(self) -> bool:
        """Whether the strips allow this test."""
        return bool(np.isfinite(self.probability))


@dataclass(frozen=True, slots=True, eq=False)
class LinearFit:
    """Least squares y = A x with equal weights.

    Attributes
    ----------
    solution : (u,) unknowns; those of the least norm where A has a defect.
    cofactor : (u, u) for a variance of one.
    squares : of the residuals.
    freedom : n − rank.
    """

    solution: Floats
    cofactor: Floats
    squares: float
    freedom: int

    @property
    def variance(self) -> float:
        """Of one observation; NaN without redundancy."""
        return self.squares / self.freedom if self.freedom > 0 else float("nan")

    def covariance(self, design: Floats, known: Floats | None = None) -> Floats:
        """(u, u) of the unknowns: by the scatter, and by known errors (n, n) of the values.

        What these give to the scatter is not counted twice.
        """
        by_scatter = self.variance * self.cofactor
        if known is None:
            return by_scatter
        gain = self.cofactor @ design.T
        of_known = gain @ known @ gain.T
        in_scatter = (np.trace(known) - np.trace(design @ of_known @ design.T)) / max(self.freedom, 1)
        return np.asarray(max(self.variance - in_scatter, 0.0) * self.cofactor + of_known)


def linear_fit(design: Floats, values: Floats) -> LinearFit:
    """Fit values (n,) by a design (n, u)."""
    if design.shape[1] == 0:
        return LinearFit(np.zeros(0), np.zeros((0, 0)), float(values @ values), len(values))
    axes = _Axes.of(design)
    cofactor = (axes.determined / axes.squares) @ axes.determined.T / np.outer(axes.scale, axes.scale)
    solution = cofactor @ (design.T @ values)
    residual = values - design @ solution
    return LinearFit(solution, cofactor, float(residual @ residual), len(values) - len(axes.squares))


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """What a design determines of its unknowns, and what not.

    Attributes
    ----------
    scale : (u,) lengths of its columns.
    determined, open : (u, r), (u, u − r) orthogonal directions of the scaled unknowns.
    squares : (r,) squared singular values of the determined ones.
    """

    scale: Floats
    determined: Floats
    open: Floats
    squares: Floats

    @classmethod
    def of(cls, design: Floats) -> _Axes:
        scale = np.linalg.norm(design, axis=0)
        scaled = design / scale
        squares, directions = np.linalg.eigh(scaled.T @ scaled)
        kept = squares > _RANK**2 * squares[-1]
        return cls(scale, directions[:, kept], directions[:, ~kept], squares[kept])


def nested_test(smaller: Floats, larger: Floats, values: Floats, known: Floats | None = None) -> NestedTest:
    """Test the larger design (n, u) against the smaller one, whose columns it contains.

    Parameters
    ----------
    known : (n, n) covariance of errors that values have in common; None: none. By as much as they make the
        decrease larger than the scatter says, the variance is larger.
    """
    small, large = linear_fit(smaller, values), linear_fit(larger, values)
    more = small.freedom - large.freedom
    if more <= 0 or large.freedom <= 0:
        return NestedTest(float("nan"), max(more, 0), max(large.freedom, 0), float("nan"))
    decrease = max(small.squares - large.squares, 0.0)
    rounding = _ROUNDING * float(values @ values)
    if large.squares <= rounding:
        # Without any scatter whatever is there is significant.
        chi_squared = np.inf if decrease > rounding else 0.0
    else:
        chi_squared = decrease / (large.variance + _beyond_scatter(smaller, larger, known, more))
    probability = float(special.fdtrc(more, large.freedom, chi_squared / more))
    return NestedTest(float(chi_squared), more, large.freedom, probability)


def _beyond_scatter(smaller: Floats, larger: Floats, known: Floats | None, more: int) -> float:
    """Variance by which known errors (n, n) make a decrease larger, for each unknown more; at least 0."""
    if known is None:
        return 0.0
    small, large = _projector(smaller), _projector(larger)
    in_decrease = float(np.trace((large - small) @ known)) / more
    rest = len(known) - float(np.trace(large))
    in_scatter = float(np.trace(known) - np.trace(large @ known)) / rest
    return max(in_decrease - in_scatter, 0.0)


def _projector(design: Floats) -> Floats:
    """(n, n) onto what a design explains."""
    if design.shape[1] == 0:
        return np.zeros((len(design), len(design)))
    axes = _Axes.of(design)
    directions = (design / axes.scale) @ (axes.determined / np.sqrt(axes.squares))
    return np.asarray(directions @ directions.T)


def map_fixed(group: Ints) -> Floats:
    """Design (2 k, 2 g) of a shift of every group (k,): east and north of each strip, one after the other."""
    return np.asarray(np.kron(membership(group), np.eye(2)), np.float64)


def body_fixed(heading: Floats, group: Ints) -> Floats:
    """Design (2 k, 2 g) of a lever arm forward, right of every group (k,) at the headings (k,)."""
    sine, cosine = np.sin(heading), np.cos(heading)
    turned = np.stack([np.stack([sine, cosine], 1), np.stack([cosine, -sine], 1)], 1)
    members = membership(group)
    # turned[k] maps (forward, right) to (east, north).
    design = members[:, None, :, None] * turned[:, :, None, :]
    return np.asarray(design.reshape(2 * len(heading), -1))


def membership(group: Ints) -> Floats:
    """(k, g) one where a strip belongs to a group; groups in ascending order."""
    return np.asarray(group[:, None] == np.unique(group), np.float64)


def without(smaller: Floats) -> Floats:
    """A design with as many rows and no unknown."""
    return smaller[:, :0]


def estimable(design: Floats, contrast: Floats) -> Bools:
    """Which rows (c,) of a contrast (c, u) a design determines."""
    axes = _Axes.of(design)
    scaled = contrast / axes.scale
    return np.asarray(np.linalg.norm(scaled @ axes.open, axis=1) < 1e-6 * np.linalg.norm(scaled, axis=1))
