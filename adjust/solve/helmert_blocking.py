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

from dataclasses import dataclass, field
from types import EllipsisType

import numpy as np

from adjust.arrays import Floats
from adjust.solve import dense_algebra, front_kernel
from adjust.solve.covisibility import Covisibility
from adjust.solve.distant_pairs import DistantPairs
from adjust.solve.fronts import FactoredFront, Front, HelmertBlocking, scalars
from adjust.solve.lanes import in_any_order

# Bytes of the inverse that are kept at most: those of some ten thousand images.
_MOST_KEPT = 2**29


@dataclass(frozen=True, eq=False)
class HelmertFactor:
    """The factorised reduced system: factors of D S D, so that metres and radians go together.

    Attributes
    ----------
    analysis : the symbolic part.
    factors : of every front.
    scale_exposure, scale_border : the diagonal matrix D, (n, 6) and (g,).
    threads : how many fronts are worked on at once.
    kept : the columns of the inverse of every front that belong to its own unknowns, if they are kept.
    """

    analysis: HelmertBlocking
    factors: tuple[FactoredFront, ...]
    scale_exposure: Floats
    scale_border: Floats
    threads: int
    kept: dict[int, Floats] = field(default_factory=dict, repr=False)

    @property
    def smallest_pivot(self) -> float:
        """Smallest squared pivot of the scaled matrix.

        With a unit diagonal it is the least 1 − R² of an unknown with those eliminated after it.
        """
        return float(min(np.min(np.diagonal(item.lower), initial=np.inf) for item in self.factors) ** 2)

    def solve(self, rhs: Floats, rhs_border: Floats) -> tuple[Floats, Floats]:
        """Solution (n, 6) and (g,) of S x = rhs for right-hand sides of these shapes.

        Or (n, 6, k) and (g, k), many together, in a fraction of the time.
        """
        x, many, g = self._forward(rhs, rhs_border), rhs.shape[2:], len(rhs_border)
        parts, of_exposures = self.analysis.rows(g), np.empty(rhs.shape)
        for front, (own, rest), factor in zip(
            self.analysis.fronts[::-1], parts[::-1], self.factors[::-1], strict=True
        ):
            mine, images = x[own], front.images[: front.own]
            dense_algebra.subtract_rows(mine, factor.below.T, x[rest])
            dense_algebra.solve_lower_transposed(factor.lower, mine)
            scale = _over(self.scale_exposure[images], many)
            of_exposures[images] = scale * mine[: 6 * front.own].reshape(front.own, 6, *many)
        return of_exposures, _over(self.scale_border, many) * x[len(x) - g :]

    def products(self, rhs: Floats, rhs_border: Floats) -> tuple[Floats, Floats]:
        """Products bᵀ S⁻¹ b (k, k) of right-hand sides, and the border (g, k) of their solutions.

        With y = L⁻¹ D b they are yᵀ y. The rows of y that a front eliminates are summed and forgotten, with
        the columns alone that reach it.

        Parameters
        ----------
        rhs, rhs_border : (n, 6, k) and (g, k); the first is used up.
        """
        count, axes = rhs.shape[2], np.arange(6)
        rhs *= self.scale_exposure[:, :, None]
        of_border = self.scale_border[:, None] * rhs_border
        found = np.zeros((count, count))
        for front, factor in zip(self.analysis.fronts[:-1], self.factors[:-1], strict=True):
            own, rest = front.images[: front.own], front.images[front.own :]
            used = np.flatnonzero(rhs[own].any(axis=(0, 1)))
            y = rhs[np.ix_(own, axes, used)].reshape(6 * len(own), len(used))
            dense_algebra.solve_lower(factor.lower, y)
            found[np.ix_(used, used)] += y.T @ y
            moved = factor.below @ y
            images = 6 * len(rest)
            front_kernel.subtract_at(rhs, rest, used, moved[:images].reshape(len(rest), 6, len(used)))
            of_border[:, used] -= moved[images:]
        own = self.analysis.fronts[-1].images
        y = np.concatenate([rhs[own].reshape(6 * len(own), count), of_border])
        dense_algebra.solve_lower(self.factors[-1].lower, y)
        border = np.linalg.solve(self._last.T, y[6 * len(own) :])
        return found + y.T @ y, np.asarray(self.scale_border[:, None] * border)

    def _forward(self, rhs: Floats, rhs_border: Floats) -> Floats:
        """Half a solution (6 n + g, …) in the order of elimination, own unknowns of a front together."""
        many, g, order = rhs.shape[2:], len(rhs_border), self.analysis.order
        x = np.zeros((6 * len(rhs) + g, *many))
        x[len(x) - g :] = _over(self.scale_border, many) * rhs_border
        # Most right-hand sides of a place are zero, and elimination reaches few fronts.
        reached = np.ones(len(x), dtype=bool)
        reached[: 6 * len(rhs)] = np.repeat((rhs != 0.0).any(axis=tuple(range(1, rhs.ndim)))[order], 6)
        for front, (own, rest), factor in zip(
            self.analysis.fronts, self.analysis.rows(g), self.factors, strict=True
        ):
            if not reached[own].any():
                continue
            images, own_rows = front.images[: front.own], x[own]
            scaled = _over(self.scale_exposure[images], many) * rhs[images]
            own_rows[: 6 * front.own] += scaled.reshape(6 * front.own, *many)
            used = _columns_in_use(own_rows)
            mine = x[own, used]
            dense_algebra.solve_lower(factor.lower, mine)
            x[rest, used] -= factor.below @ mine
            reached[rest] = True
        return x

    @property
    def _last(self) -> Floats:
        """Factor L_gg (g, g) of the system parameters."""
        g, root = len(self.scale_border), self.factors[-1].lower
        return np.tril(root[root.shape[0] - g :, root.shape[1] - g :])

    def border_normal(self) -> Floats:
        """Normal matrix (g, g) of the system parameters, exposures eliminated: N = L_gg L_ggᵀ without D."""
        return np.asarray(self._last @ self._last.T / (self.scale_border[:, None] * self.scale_border))

    def inverse(
        self, pattern: Covisibility | None = None, keep: bool = False
    ) -> tuple[Floats, Floats, Floats]:
        """Blocks of S⁻¹: (blocks, 6, 6) on a pattern, (n, 6, g) border, (g, g) corner.

        Parameters
        ----------
        pattern : which blocks are wanted, diagonal first; None: those of the normal equations.
        keep : keep what serves other patterns, too, as long as it is not too large; it takes as much memory
            as the factor.
        """
        keep = keep and sum(item.lower.nbytes + item.below.nbytes for item in self.factors) <= _MOST_KEPT
        analysis, scale, of_border = self.analysis, self.scale_exposure, self.scale_border
        n, g = analysis.pattern.events, len(of_border)
        pattern = pattern or analysis.pattern
        held, missing = analysis.placed(pattern)
        lifted = DistantPairs.of(analysis, pattern, missing).lifted(analysis.fronts, self.factors)
        blocks = np.empty((len(pattern.column), 6, 6))
        border = np.empty((n, 6, g))
        corner = np.empty((g, g))
        inverses: dict[int, Floats] = {}

        def invert(index: int) -> Floats:
            front, factor = analysis.fronts[index], self.factors[index]
            known = None if front.parent < 0 else inverses[front.parent]
            z = _front_inverse(front, factor, known, g, self.kept.get(index))
            if keep:
                self.kept[index] = z[:, : factor.lower.shape[1]].copy(order="F")
            at = held[index]
            front_kernel.disassemble(
                z.T, at.blocks, at.lower, at.upper, at.transposed, front.images, scale, blocks
            )
            lifted.fill(index, z, scale, blocks)
            own, size = front.images[: front.own], 6 * (front.own + front.rest)
            of_own = z[size:, : 6 * front.own].T.reshape(front.own, 6, g)
            border[own] = scale[own][:, :, None] * of_own * of_border
            if front.parent < 0:
                half = np.tril(z[size:, size:])
                corner[:] = of_border[:, None] * (half + np.tril(half, -1).T) * of_border
            return z

        def work(portion: range) -> None:
            for index in reversed(portion):
                z, parent = invert(index), analysis.fronts[index].parent
                if analysis.children[index]:
                    inverses[index] = z
                # The first child is the last one that needs it.
                if parent in portion and analysis.children[parent][0] == index:
                    del inverses[parent]

        for step in reversed(analysis.steps):
            in_any_order(work, step, self.threads)
        return blocks, border, corner


def _over(scale: Floats, many: tuple[int, ...]) -> Floats:
    """Factors that apply to every one of many right-hand sides."""
    return scale[(..., *(np.newaxis,) * len(many))]


def _columns_in_use(rows: Floats) -> slice | EllipsisType:
    """From the first to the last column that is not zero; right-hand sides of a place reach few fronts."""
    if rows.ndim == 1:
        return ...
    used = np.flatnonzero(rows.any(axis=0))
    return slice(used[0], used[-1] + 1) if len(used) else slice(0)


def _front_inverse(
    front: Front, factor: FactoredFront, known: Floats | None, border: int, kept: Floats | None
) -> Floats:
    """Lower triangle of the inverse of the whole matrix on the unknowns of a front, from its parent's.

    kept (p + q, p) are its first columns, if they are known.
    """
    p, q = factor.lower.shape[0], factor.below.shape[0]
    inverse = np.empty((p + q, p + q), order="F")
    square, side, rest = inverse[:p, :p], inverse[p:, :p], inverse[p:, p:]
    if known is not None and q > 0:
        front_kernel.gather(known.T, scalars(front.in_parent, known.shape[0], border), inverse.T, p)
    if kept is not None:
        inverse[:, :p] = kept
        return inverse
    dense_algebra.invert_square(factor.lower, square)
    if known is not None and q > 0:
        # G = M L⁻¹; with it Z21 = −Z22 G and Z11 = (L Lᵀ)⁻¹ − Gᵀ Z21.
        gain = dense_algebra.times_inverse(factor.below, factor.lower)
        dense_algebra.negative_product(rest, gain, side)
        dense_algebra.subtract_product(square, gain, side)
    return inverse


def factorize_blocks(
    analysis: HelmertBlocking,
    blocks: Floats,
    border: Floats,
    corner: Floats,
    scale_exposure: Floats,
    scale_border: Floats,
    threads: int,
) -> HelmertFactor | None:
    """Factorise a positive definite block matrix; None if it is not positive definite.

    Parameters
    ----------
    blocks : (blocks, 6, 6) upper block triangle on the pattern, diagonal blocks in full.
    border : (n, 6, g).  corner : (g, g).
    scale_exposure, scale_border : (n, 6) and (g,), positive: rows and columns are multiplied by them
        before anything else; best such that the diagonal becomes 1.
    """
    g = corner.shape[0]
    fronts, children = analysis.fronts, analysis.children
    left: dict[int, Floats] = {}
    factors: list[FactoredFront | None] = [None] * len(fronts)
    memory = _columns(fronts, g)

    def eliminate(index: int) -> None:
        front, held, columns = fronts[index], fronts[index].held, memory[index]
        size, p = columns.shape
        columns.fill(0.0)
        # Without children nothing is there yet, and nothing has to be set to zero.
        rest = (np.zeros if children[index] else np.empty)((size - p, size - p), order="F")
        front_kernel.assemble(
            columns.T, blocks, held.blocks, held.lower, held.upper, held.transposed, front.images,
            scale_exposure,
        )  # fmt: skip
        own = front.images[: front.own]
        of_own = scale_exposure[own][:, :, None] * border[own] * scale_border
        columns[size - g :, : 6 * front.own] = of_own.reshape(6 * front.own, g).T
        if front.parent < 0:
            columns[size - g :, 6 * front.own :] = scale_border[:, None] * corner * scale_border
        for child in children[index]:
            at = scalars(fronts[child].in_parent, size, g)
            front_kernel.extend(columns.T, rest.T, left.pop(child).T, at)
        if dense_algebra.factorize_columns(columns):
            below = columns[p:]
            dense_algebra.subtract_square(rest, below, fresh=not children[index])
            factors[index], left[index] = FactoredFront(columns[:p], below), rest

    def work(portion: range) -> None:
        for index in portion:
            eliminate(index)
            if factors[index] is None:
                return

    for step in analysis.steps:
        in_any_order(work, step, threads)
        if any(factors[portion[-1]] is None for portion in step):
            return None
    found = tuple(item for item in factors if item is not None)
    return HelmertFactor(analysis, found, scale_exposure, scale_border, threads)


def _columns(fronts: tuple[Front, ...], border: int) -> list[Floats]:
    """Memory for the first columns (p + q, p) of every front.

    Of the calling thread: what it has given back it gets again, whereas threads that come and go get memory
    from the system, page by page and the more slowly the more of them there are.
    """
    found = []
    for front in fronts:
        p = 6 * front.own + (border if front.parent < 0 else 0)
        found.append(np.empty((6 * (front.own + front.rest) + border, p), order="F"))
    return found
