"""Systematic image errors over the format, as mean residuals speak for them.

Mean residuals m of a set of images show what has to be added to its image coordinates, f, through the
adjustment: m = M f + η, with the noise η of covariance V. f is taken for a sum of random fields f_j of
different lengths L_j, with the variance s_j² and the correlation exp(−(d/L_j)²) of each coordinate: some over
the whole format, some of each CCD image by itself. One more is radial, as most of what lenses have: a random
function of the distance r from the middle, correlated by (r r'/R²) exp(−((r − r')/L)²), with the largest
distance R. It is what blocks imitate most easily, and other fields would have to be large to contain it.
With roots K_j of their correlation matrices

    f = K a,    a ~ N(0, 1),    K = (s_1 K_1, s_2 K_2, …),    C = K Kᵀ
    f̂ = C Mᵀ (M C Mᵀ + V)⁻¹ m,    Cov(f) = C − C Mᵀ (M C Mᵀ + V)⁻¹ M C = K (1 + KᵀMᵀ V⁻¹ M K)⁻¹ Kᵀ

is what has to be expected (collocation; Moritz 1980). The s_j² are those for which m ~ N(0, M C Mᵀ + V) is
the most probable (maximum likelihood; Koch 1986). Fields of several sets of images have nothing in common,
and s_j² of their own; what M and V say of them is taken together.

What orientations and object points imitate of f shows in no mean: there the covariance remains what it was.
Where the means hardly tell an s_j, the search ends early, and so it begins with large ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from adjust.arrays import Bools, Floats
from adjust.residual_grid.format_cells import Division, FormatCells

# Correlation lengths, in parts of the longer side of the format.
_LENGTHS = (0.1, 0.25, 0.6)
_RADIAL_LENGTH = 0.25
# Part of the mean variance of the noise that is added to it: what the unknowns imitate has none.
_FLOOR = 1e-6
# Columns of a root that add less than this part of the largest variance are left out.
_SMALL = 1e-4
# Logarithm of the variance of a signal over that of the noise: where the search begins, and its limits.
_START, _RANGE = 4.0, (-14.0, 26.0)
# Directions in which fields of the largest variance add less than this part of the noise tell nothing.
_FAINT = 1e-4
# The variance of a field is at most this part of the mean square of the means.
_LARGEST = 100.0
# Part of the logarithm of the probability by which it has to grow in a step.
_SETTLED = 1e-7


@dataclass(frozen=True, eq=False)
class Places:
    """Where the field of a set of images has a value: cells, and (2, k) which coordinates of them."""

    cells: FormatCells
    known: Bools

    @property
    def count(self) -> int:
        """Number c of places."""
        return int(self.known.sum())


@dataclass(frozen=True, eq=False)
class ExpectedField:
    """What has to be expected of a field at c places: coordinates and cells.

    Attributes
    ----------
    evidence : twice the logarithm of how many times as probable the means are with the field as without.
    value : (c,) its most probable values, metres.
    root : (c, r) root of its covariance, metres.
    """

    evidence: float
    value: Floats
    root: Floats

    @property
    def sigma(self) -> float:
        """RMS of the field, of its most probable values and their standard deviations, metres."""
        return self.sigma_of(slice(None))

    def sigma_of(self, part: slice) -> float:
        """The same at some of the places."""
        value, root = self.value[part], self.root[part]
        return float(np.sqrt((np.sum(value**2) + np.sum(root**2)) / len(value)))


def expected_field(
    places: Sequence[Places], means: Floats, response: Floats, noise: Floats, contained: Floats
) -> ExpectedField:
    """The field that mean residuals speak for.

    Parameters
    ----------
    places : of every set of images, those that have a mean; the c places in this order.
    means : (c,) metres.
    response : (c, c) M.
    noise : (c, c) V, m².
    contained : (c, c) projection of any field onto what this one can contain.
    """
    c, first, roots = len(means), 0, list[Floats]()
    for own in places:
        part = contained[:, first : first + own.count]
        roots += [field for root in _roots(own) if _is_large(field := part @ root, root)]
        first += own.count
    nothing = ExpectedField(0.0, np.zeros(c), np.zeros((c, 0)))
    if not roots:
        return nothing
    lower = np.linalg.cholesky(noise + _FLOOR * np.mean(np.diagonal(noise)) * np.eye(c))
    observed, through = (linalg.solve_triangular(lower, item, lower=True) for item in (means, response))
    shown = [through @ root for root in roots]
    variance, evidence = _variances(shown, observed, _LARGEST * float(np.mean(means**2)))
    there = [np.sqrt(own) * part for own, part in zip(variance, roots, strict=True) if own > 0.0]
    if not there:
        return nothing
    root = np.concatenate(there, axis=1)
    visible = through @ root
    lower = np.linalg.cholesky(np.eye(root.shape[1]) + visible.T @ visible)
    half, told = (linalg.solve_triangular(lower, item, lower=True) for item in (root.T, visible.T @ observed))
    value, left = half.T @ told, half.T
    return ExpectedField(evidence, value, left)


def _roots(places: Places) -> list[Floats]:
    """Roots K_j (c, r) of the correlations of the fields of one set."""
    cells, known = places.cells, places.known
    ways = (True, False) if cells.tile.any() else (True,)
    correlated = [_correlation_root(cells, known, length, across) for across in ways for length in _LENGTHS]
    return [*correlated, _radial_root(cells, known)]


def _is_large(contained: Floats, field: Floats) -> bool:
    """Whether something is left of a field."""
    return float(np.sum(contained**2)) > _SMALL * float(np.sum(field**2))


def _variances(shown: list[Floats], observed: Floats, most: float) -> tuple[Floats, float]:
    """The s_j² (j,), and the evidence for them.

    Parameters
    ----------
    shown, observed : M K_j (c, r) and m (c,), with 1 as the covariance of the noise.
    most : upper limit, for what the means do not tell.
    """
    # Over the variance of the noise, in the mean; what no mean shows at all is nothing or the limit.
    size = np.maximum([np.sum(part**2) / len(part) for part in shown], np.exp(_RANGE[0] + 2.0) / most)
    upper = np.clip(np.log(size * most), *_RANGE)
    every = np.concatenate(shown, axis=1)
    values, vectors = linalg.eigh(every @ every.T)
    telling = vectors[:, min(np.searchsorted(values * most, _FAINT), len(values) - 1) :]
    observed, weights = telling.T @ observed, np.array([_square(telling.T @ part) for part in shown])

    def loss(logarithms: Floats) -> tuple[float, Floats]:
        """−log of the probability of the means, but for a constant, and its derivatives."""
        variance = np.exp(logarithms) / size
        lower = np.linalg.cholesky(np.eye(len(observed)) + np.tensordot(variance, weights, axes=1))
        inverse, _ = linalg.lapack.dpotri(lower, lower=True)
        inverse += np.tril(inverse, -1).T
        told = inverse @ observed
        value = np.sum(np.log(np.diagonal(lower))) + 0.5 * observed @ told
        own = [np.vdot(inverse, weight) - told @ weight @ told for weight in weights]
        return float(value), 0.5 * variance * np.array(own)

    # Loaded late: blocks without corrections do not need it, and it takes a tenth of a second.
    from scipy import optimize

    found = optimize.minimize(
        loss,
        np.minimum(_START, upper),
        jac=True,
        method="L-BFGS-B",
        bounds=[(_RANGE[0], limit) for limit in upper],
        options={"ftol": _SETTLED},
    )
    variance = np.exp(found.x) / size
    return np.where(found.x > _RANGE[0] + 1.0, variance, 0.0), float(observed @ observed - 2.0 * found.fun)


def _square(root: Floats) -> Floats:
    return root @ root.T


def _correlation_root(cells: FormatCells, known: Bools, length: float, across: bool) -> Floats:
    """Root K (c, r) of the correlations of all places; those of x and y have nothing in common.

    exp(−(d/L)²) is a product of those along the two sides, and so is its root.
    """
    scale = length * _longer_side(cells)
    of_x, of_y = (_root_along(side, scale, across) for side in (cells.along_x, cells.along_y))
    root = np.kron(of_y, of_x)
    size = np.sum(root**2, axis=0)
    root = root[:, size > _SMALL * size.max()]
    return np.asarray(linalg.block_diag(*(root[own] for own in known)))


def _radial_root(cells: FormatCells, known: Bools) -> Floats:
    """Root K (c, r) of the correlations of a radial field, whose parts along x and y belong together."""
    x, y = cells.middles.T
    distance = np.hypot(x, y)
    relative = distance / max(float(distance.max()), 1e-9)
    apart = (distance[:, None] - distance) / (_RADIAL_LENGTH * _longer_side(cells))
    values, vectors = linalg.eigh(np.outer(relative, relative) * np.exp(-(apart**2)))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    root = root[:, values > _SMALL * values.max()]
    outwards = [side / np.maximum(distance, 1e-9) for side in (x, y)]
    return np.concatenate([(out[:, None] * root)[own] for out, own in zip(outwards, known, strict=True)])


def _longer_side(cells: FormatCells) -> float:
    return max(float(np.ptp(side.edges)) for side in (cells.along_x, cells.along_y))


def _root_along(side: Division, length: float, across: bool) -> Floats:
    """Root (n, n) of the correlations of the parts of a side."""
    apart = side.middles[:, None] - side.middles
    same = across | (side.tile[:, None] == side.tile)
    values, vectors = linalg.eigh(np.where(same, np.exp(-((apart / length) ** 2)), 0.0))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
