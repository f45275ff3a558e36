"""Helmert blocking: factorisation, solution and selected inverse of the reduced normal equations.

Every part of the dissection has a *front*: the dense matrix of its own exposures, of the later
exposures its elimination connects, and of the system parameters, which come last of all. With own
unknowns 1 and the rest 2,

    F11 = L Lᵀ,   M = F21 L⁻ᵀ,   what is left:  F22 − M Mᵀ  is added to the parent's front.

Backwards, from the root to the parts, the same fronts give the blocks of the inverse Z = S⁻¹ on the
pattern, without anything else of it: with G = M L⁻¹

    Z12 = −Gᵀ Z22,   Z11 = (L Lᵀ)⁻¹ + Gᵀ Z22 G

(Erisman and Tinney 1975, blockwise). Parts of equal height are independent; each front is always
summed in the same order, so the result does not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.linalg import blas, lapack

from adjust.arrays import Bools, Floats, Ints
from adjust.solve.covisibility import Covisibility
from adjust.solve.dissection import LARGEST_PART, Dissection, dissect


@dataclass(frozen=True, eq=False)
class Front:
    """Where everything of one part stands in its front, in units of exposures.

    Attributes
    ----------
    own, rest : numbers of own and of boundary exposures.
    images : (own + rest,) the exposures in the order of the front.
    parent : index of the parent's front, −1 for the root.
    height : see :class:`~adjust.solve.dissection.Part`.
    in_parent : (rest,) place of the boundary exposures in the parent's front.
    blocks : (k,) the pattern's blocks that are assembled here.
    lower, upper : (k,) their row and column in the front, lower ≥ upper.
    transposed : (k,) whether the pattern holds the transposed block.
    """

    own: int
    rest: int
    images: Ints
    parent: int
    height: int
    in_parent: Ints
    blocks: Ints
    lower: Ints
    upper: Ints
    transposed: Bools


@dataclass(frozen=True, eq=False)
class HelmertBlocking:
    """Symbolic analysis of a block: made once, used in every iteration.

    Attributes
    ----------
    pattern : which exposure blocks there are.
    fronts : in the order of elimination.
    """

    pattern: Covisibility
    fronts: tuple[Front, ...]

    @classmethod
    def of(cls, pattern: Covisibility, position: Floats, largest_part: int = LARGEST_PART) -> HelmertBlocking:
        """Analyse a pattern; positions (n, 3) and the largest part only steer the cuts."""
        return cls(pattern, _fronts(pattern, dissect(pattern, position, largest_part)))

    def levels(self) -> list[list[int]]:
        """Indices of the fronts by height, the parts without children first."""
        top = max(front.height for front in self.fronts)
        levels: list[list[int]] = [[] for _ in range(top + 1)]
        for index, front in enumerate(self.fronts):
            levels[front.height].append(index)
        return levels


@dataclass(frozen=True, eq=False)
class FactoredFront:
    """L (p, p) lower triangular and M (q, p) of one front, Fortran order."""

    lower: Floats
    below: Floats


def _fronts(pattern: Covisibility, dissection: Dissection) -> tuple[Front, ...]:
    """Place every block of the pattern and every boundary in the fronts."""
    parts, rank = dissection.parts, dissection.rank
    part_of_rank = np.repeat(np.arange(len(parts)), [len(part.own) for part in parts])
    row, column = pattern.row, pattern.column
    first = np.minimum(rank[row], rank[column])
    owner = part_of_rank[first]
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(len(parts) + 1))
    place = np.empty(pattern.images, dtype=np.int64)
    images = [np.concatenate([part.own, part.boundary]) for part in parts]
    fronts = []
    for index, part in enumerate(parts):
        mine = order[starts[index] : starts[index + 1]]
        place[images[index]] = np.arange(len(images[index]))
        at_row, at_column = place[row[mine]], place[column[mine]]
        if part.parent >= 0:
            place[images[part.parent]] = np.arange(len(images[part.parent]))
        fronts.append(
            Front(
                own=len(part.own),
                rest=len(part.boundary),
                images=images[index],
                parent=part.parent,
                height=part.height,
                in_parent=place[part.boundary] if part.parent >= 0 else np.empty(0, dtype=np.int64),
                blocks=mine,
                lower=np.maximum(at_row, at_column),
                upper=np.minimum(at_row, at_column),
                # Block (i, j) of the pattern stands at row i; below the diagonal it is transposed.
                transposed=at_row < at_column,
            )
        )
    return tuple(fronts)


@dataclass(frozen=True, eq=False)
class HelmertFactor:
    """The factorised reduced system, scaled to unit diagonal.

    Attributes
    ----------
    analysis : the symbolic part.
    factors : of every front.
    border : number g of system parameters.
    threads : how many fronts are worked on at once.
    """

    analysis: HelmertBlocking
    factors: tuple[FactoredFront, ...]
    border: int
    threads: int

    @property
    def smallest_pivot(self) -> float:
        """Smallest squared pivot: the least 1 − R² of an unknown with those eliminated after it."""
        return float(min(np.min(np.diagonal(item.lower), initial=np.inf) for item in self.factors) ** 2)

    def solve(self, rhs: Floats, rhs_border: Floats) -> tuple[Floats, Floats]:
        """Solution (n, 6) and (g,) for right-hand sides of these shapes."""
        x, border = rhs.copy(), rhs_border.copy()
        fronts = self.analysis.fronts
        for front, factor in zip(fronts, self.factors, strict=True):
            own, rest = front.images[: front.own], front.images[front.own :]
            mine = np.concatenate([x[own].ravel(), border if front.parent < 0 else border[:0]])
            mine = scipy.linalg.solve_triangular(factor.lower, mine, lower=True, check_finite=False)
            taken = factor.below @ mine
            x[own] = mine[: 6 * front.own].reshape(-1, 6)
            x[rest] -= taken[: 6 * front.rest].reshape(-1, 6)
            border = mine[6 * front.own :] if front.parent < 0 else border - taken[6 * front.rest :]
        for front, factor in zip(fronts[::-1], self.factors[::-1], strict=True):
            own, rest = front.images[: front.own], front.images[front.own :]
            mine = np.concatenate([x[own].ravel(), border if front.parent < 0 else border[:0]])
            known = np.concatenate([x[rest].ravel(), border[:0] if front.parent < 0 else border])
            mine = scipy.linalg.solve_triangular(
                factor.lower, mine - factor.below.T @ known, lower=True, trans="T", check_finite=False
            )
            x[own] = mine[: 6 * front.own].reshape(-1, 6)
            border = mine[6 * front.own :] if front.parent < 0 else border
        return x, border

    def inverse(self) -> tuple[Floats, Floats, Floats]:
        """Blocks of the inverse: (blocks, 6, 6) on the pattern, (n, 6, g) border, (g, g) corner."""
        analysis, g = self.analysis, self.border
        n = analysis.pattern.images
        blocks = np.empty((len(analysis.pattern.column), 6, 6))
        border = np.empty((n, 6, g))
        corner = np.empty((g, g))
        inverses: dict[int, Floats] = {}

        def work(index: int) -> None:
            front, factor = analysis.fronts[index], self.factors[index]
            known = None if front.parent < 0 else inverses[front.parent]
            z = _front_inverse(front, factor, known, g)
            inverses[index] = z
            size = 6 * (front.own + front.rest)
            view = z[:size, :size].reshape(front.own + front.rest, 6, front.own + front.rest, 6)
            found = view[front.lower, :, front.upper, :]
            found[front.transposed] = np.swapaxes(found[front.transposed], 1, 2)
            blocks[front.blocks] = found
            own = front.images[: front.own]
            border[own] = z[: 6 * front.own, size:].reshape(front.own, 6, g)
            if front.parent < 0:
                corner[:] = z[size:, size:]

        for level in reversed(analysis.levels()):
            _in_parallel(work, level, self.threads)
            # A parent's inverse is needed until its last child is done; children are one level below or more.
            _forget(inverses, analysis.fronts, level)
        return blocks, border, corner


def _forget(inverses: dict[int, Floats], fronts: tuple[Front, ...], done: list[int]) -> None:
    """Drop the inverses of fronts all of whose children are done."""
    height = fronts[done[0]].height
    needed = {front.parent for front in fronts if front.height < height}
    for index in [index for index in inverses if index not in needed]:
        del inverses[index]


def _front_inverse(front: Front, factor: FactoredFront, known: Floats | None, border: int) -> Floats:
    """Inverse of the whole matrix on the unknowns of one front, from that of its parent."""
    own = _own_inverse(factor.lower)
    p, q = factor.lower.shape[0], factor.below.shape[0]
    if known is None or q == 0:
        return own
    take = _scalars(front.in_parent, known.shape[0], border)
    rest = known[np.ix_(take, take)]
    if p == 0:
        return rest
    # G = M L⁻¹; with it Z12 = −Gᵀ Z22.
    gain = blas.dtrsm(1.0, factor.lower, factor.below, side=1, lower=1)
    side = gain.T @ rest
    z = np.empty((p + q, p + q))
    z[:p, :p] = own + side @ gain
    z[:p, p:] = -side
    z[p:, :p] = -side.T
    z[p:, p:] = rest
    return z


def _own_inverse(lower: Floats) -> Floats:
    """(L Lᵀ)⁻¹, symmetric; empty for an empty factor."""
    if lower.shape[0] == 0:
        return np.zeros((0, 0))
    inverse, info = lapack.dpotri(lower, lower=1)
    if info != 0:
        raise np.linalg.LinAlgError("a front of the normal equations cannot be inverted")
    return np.asarray(np.tril(inverse) + np.tril(inverse, -1).T)


def _scalars(exposures: Ints, size: int, border: int) -> Ints:
    """Scalar indices of exposures in a front of the given size, and of its system parameters."""
    six = (6 * exposures[:, None] + np.arange(6)).ravel()
    return np.concatenate([six, np.arange(size - border, size)])


def factorize_blocks(
    analysis: HelmertBlocking, blocks: Floats, border: Floats, corner: Floats, threads: int
) -> HelmertFactor | None:
    """Factorise a positive definite block matrix; None if it is not positive definite.

    Parameters
    ----------
    blocks : (blocks, 6, 6) upper block triangle on the pattern, diagonal blocks in full.
    border : (n, 6, g).  corner : (g, g).
    """
    g = corner.shape[0]
    fronts = analysis.fronts
    left: dict[int, Floats] = {}
    factors: list[FactoredFront | None] = [None] * len(fronts)
    children: list[list[int]] = [[] for _ in fronts]
    for index, front in enumerate(fronts):
        if front.parent >= 0:
            children[front.parent].append(index)

    def work(index: int) -> None:
        front = fronts[index]
        matrix = _assembled(front, blocks, border, corner)
        for child in children[index]:
            update = left.pop(child, None)
            if update is None:
                return
            at = _scalars(fronts[child].in_parent, matrix.shape[0], g)
            matrix[np.ix_(at, at)] += update
        p = 6 * front.own + (g if front.parent < 0 else 0)
        eliminated = _eliminate(matrix, p)
        if eliminated is not None:
            factors[index], left[index] = eliminated

    for level in analysis.levels():
        _in_parallel(work, level, threads)
        if any(factors[index] is None for index in level):
            return None
    return HelmertFactor(analysis, tuple(item for item in factors if item is not None), g, threads)


def _eliminate(matrix: Floats, p: int) -> tuple[FactoredFront, Floats] | None:
    """Eliminate the first p unknowns of a front: its factor and what is left; None if not positive."""
    q = matrix.shape[0] - p
    # Separators of disconnected parts are empty, and LAPACK takes no empty matrices.
    if p == 0:
        return FactoredFront(np.zeros((0, 0)), np.zeros((q, 0))), matrix
    lower, info = lapack.dpotrf(matrix[:p, :p], lower=1, clean=1)
    if info != 0:
        return None
    if q == 0:
        return FactoredFront(lower, np.zeros((0, p))), np.zeros((0, 0))
    below = blas.dtrsm(1.0, lower, matrix[p:, :p], side=1, lower=1, trans_a=1)
    return FactoredFront(lower, below), blas.dsyrk(-1.0, below, beta=1.0, c=matrix[p:, p:], lower=1)


def _assembled(front: Front, blocks: Floats, border: Floats, corner: Floats) -> Floats:
    """Front with the original equations of its own exposures; only the lower triangle counts."""
    g = corner.shape[0]
    k = front.own + front.rest
    matrix = np.zeros((6 * k + g, 6 * k + g), order="F")
    chosen = blocks[front.blocks]
    chosen[front.transposed] = np.swapaxes(chosen[front.transposed], 1, 2)
    rows = 6 * front.lower[:, None, None] + np.arange(6)[:, None]
    matrix[rows, 6 * front.upper[:, None, None] + np.arange(6)] = chosen
    own = front.images[: front.own]
    matrix[6 * k :, : 6 * front.own] = border[own].reshape(6 * front.own, g).T
    if front.parent < 0:
        matrix[6 * k :, 6 * k :] = corner
    return matrix


def _in_parallel(work: Callable[[int], None], indices: Iterable[int], threads: int) -> None:
    """Call work for every index, on several threads where there are; their order does not matter."""
    indices = list(indices)
    if threads <= 1 or len(indices) == 1:
        for index in indices:
            work(index)
        return
    with ThreadPoolExecutor(max_workers=threads) as pool:
        for _ in pool.map(work, indices):
            pass
