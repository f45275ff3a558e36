"""The matrix S of the variance components: traces of products of R = Q_vv P, which are found by probing.

S_gh = tr(R K_g R K_h) with K one on the rows of a part, for a correlation time see
:mod:`adjust.quality.correlation_time`. R is too large to be formed; for z of random signs on part h,
E ‖(R z)_g‖² = S_gh (Hutchinson 1990).

Considered parameters count as observed: with W = B̃ R (1 + RᵀS̃R)^(−½) of their errors, Q_vv P is R − W Wᵀ in
the place of R, so z loses W Wᵀz. It is no longer idempotent, but as R W = W, its square is R − W Wᵀ − W F Wᵀ
with F = 1 − WᵀW.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import ObservationGroup
from adjust.quality import correlation_time
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.observation_parts import Part
from adjust.quality.residual_operator import ResidualOperator, ResidualOperatorOfOthers
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System

# Σ ‖(R z)_g‖² over so many degrees of freedom pins S_gg to √(2/800) = 5 %, its root to half of that.
_PROBED = 800.0
_MOST_PROBES = 40
# Vectors that are solved for together.
_AT_ONCE = 16


@dataclass(frozen=True, eq=False)
class _Residuals:
    """R z of vectors z, less what errors of considered parameters take.

    Attributes
    ----------
    operator : R.
    spread : W (n, m, k) of the groups of the operator; k = 0 without considered parameters.
    remaining : F (k, k).
    """

    operator: ResidualOperator | ResidualOperatorOfOthers
    spread: tuple[Floats, ...]
    remaining: Floats

    @classmethod
    def of(
        cls,
        operator: ResidualOperator | ResidualOperatorOfOthers,
        groups: tuple[ObservationGroup, ...],
        considered: ConsideredErrors | None,
    ) -> Self:
        """Of the groups of an operator."""
        if considered is None:
            none = tuple(np.zeros((*group.stochastic.present.shape, 0)) for group in groups)
            return cls(operator, none, np.zeros((0, 0)))
        root = considered.remaining_root
        spread = tuple(considered.of_whitened(group) @ root for group in groups)
        return cls(operator, spread, root.T @ root)

    def of_vectors(self, vectors: tuple[Floats, ...]) -> tuple[Floats, ...]:
        """Of d vectors (n, m, d), or of one (n, m), of every group."""
        along = self._along(vectors)
        found = zip(self.operator.residuals(vectors), self.spread, strict=True)
        return tuple(one - spread @ along for one, spread in found)

    def lost(self, one: tuple[Floats, ...], other: tuple[Floats, ...]) -> float:
        """Σ yᵀ W F Wᵀ z of vectors (n, m, d)."""
        return float(np.sum(self._along(one) * (self.remaining @ self._along(other))))

    @property
    def lost_elsewhere(self) -> float:
        """tr(W F Wᵀ) of all other observations."""
        own = sum(np.tensordot(w, w, axes=([0, 1], [0, 1])) for w in self.spread)
        return float(np.sum(self.remaining * (np.eye(len(self.remaining)) - self.remaining - own)))

    def _along(self, vectors: tuple[Floats, ...]) -> Floats:
        """Wᵀ z (k, d) or (k,)."""
        pairs = zip(self.spread, vectors, strict=True)
        return np.asarray(sum(np.tensordot(w, z, axes=([0, 1], [0, 1])) for w, z in pairs))


def trace_matrix(
    system: System,
    solution: Solution,
    parts: tuple[Part, ...],
    redundancy: Floats,
    considered: ConsideredErrors | None = None,
) -> Floats:
    """S_gh of the parts, (parts, parts), by probing with random signs from a fixed seed.

    Correlated components of an observation are distinguished after whitening. Image points that are one part
    need no probing: what a vector z on another part has there is zᵀ R z without that of the other groups, and
    as R is idempotent, a row of S with all observations sums up to r.

    Parameters
    ----------
    redundancy : (parts,) of the parts; weak parts are probed more often.
    considered : errors of considered parameters of the block.
    """
    random, traces = np.random.default_rng(0), np.zeros((len(parts), len(parts)))
    number = np.clip(np.ceil(_PROBED / redundancy), 1, _MOST_PROBES).astype(np.int64)
    rays = [k for k, part in enumerate(parts) if part.group == 0]
    others = [k for k, part in enumerate(parts) if part.group > 0]
    whole = [k for k in rays if parts[k].rows is None]
    groups = system.observations.groups
    operator = ResidualOperatorOfOthers.of(system, solution)
    residuals = _Residuals.of(operator, groups[1:], considered)
    for h in others:
        for count in _portions(int(number[h])):
            of_others, of_rays = _probed_others(residuals, groups, parts, h, count, random)
            traces[others, h] += of_others[others] / number[h]
            traces[whole, h] += of_rays / number[h]
    traces[np.ix_(others, others)] = _symmetric(traces[np.ix_(others, others)])
    if whole:
        traces[others, whole[0]] = traces[whole[0], others]
        shared = _shared_with_others(residuals, groups[1:], int(number[whole[0]]), random)
        traces[whole[0], whole[0]] = redundancy[whole[0]] - residuals.lost_elsewhere - shared
    elif rays:
        every = _Residuals.of(ResidualOperator.of(system, solution), groups, considered)
        _probe_rays(every, groups, parts, number, random, traces)
    return traces


def _symmetric(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.T))


def _portions(probes: int) -> Iterator[int]:
    """So many probes, some at a time."""
    for first in range(0, probes, _AT_ONCE):
        yield min(_AT_ONCE, probes - first)


def _probed_others(
    residuals: _Residuals,
    groups: tuple[ObservationGroup, ...],
    parts: tuple[Part, ...],
    h: int,
    count: int,
    random: np.random.Generator,
) -> tuple[Floats, float]:
    """Sums of (R z)_g (R K z)_g over vectors z on a part h: (parts,) of the others; and of image points."""
    part = parts[h]
    signs = changed = _signs(groups, part, count, random)
    found = with_signs = residuals.of_vectors(signs)
    own = signs[part.group - 1]
    if part.is_correlation:
        its = _along_derivative(groups[part.group], own)
        changed = tuple(its if one is own else one for one in signs)
        found = residuals.of_vectors(changed)
    # zᵀ R² K z, which is the sum over all observations.
    total = float(np.sum(own * found[part.group - 1])) - residuals.lost(signs, changed)
    of_rays = total - sum(float(np.sum(a * b)) for a, b in zip(with_signs, found, strict=True))
    sums = np.zeros(len(parts))
    for g, other in enumerate(parts):
        if other.group > 0:
            one, its = with_signs[other.group - 1], found[other.group - 1]
            if other.is_correlation:
                its = _along_derivative(groups[other.group], its)
            root = _roots(groups[other.group])[:, :, None]
            sums[g] = np.sum((root * one)[other.place] * its[other.place])
    return sums, of_rays


def _shared_with_others(
    residuals: _Residuals, others: tuple[ObservationGroup, ...], probes: int, random: np.random.Generator
) -> float:
    """tr(R K_g R K_h) of all image points with all other observations."""
    found = 0.0
    for count in _portions(probes):
        signs = tuple(
            np.where(present[:, :, None], random.choice((-1.0, 1.0), (*present.shape, count)), 0.0)
            for present in (group.stochastic.present for group in others)
        )
        found -= residuals.lost(signs, signs) / probes
        for z, own in zip(signs, residuals.of_vectors(signs), strict=True):
            found += float(np.sum(own * (z - own))) / probes
    return found


def _probe_rays(
    residuals: _Residuals,
    groups: tuple[ObservationGroup, ...],
    parts: tuple[Part, ...],
    number: Ints,
    random: np.random.Generator,
    traces: Floats,
) -> None:
    """Fill the rows and columns of image points in several parts."""
    rays = [k for k, part in enumerate(parts) if part.group == 0]
    for h in rays:
        for _ in range(number[h]):
            signs = [np.zeros(group.stochastic.present.shape) for group in groups]
            present = groups[0].stochastic.present[parts[h].rows]
            signs[0][parts[h].place] = present * random.choice((-1.0, 1.0), present.shape)
            found = residuals.of_vectors(tuple(signs))
            for g, other in enumerate(parts):
                its = found[other.group]
                if other.is_correlation:
                    its = correlation_time.along_derivative(groups[other.group].stochastic, its)
                shared = _roots(groups[other.group]) * found[other.group] * its
                traces[g, h] += float(np.sum(shared[other.place])) / number[h]
    others = [k for k, part in enumerate(parts) if part.group > 0]
    traces[np.ix_(rays, rays)] = _symmetric(traces[np.ix_(rays, rays)])
    traces[np.ix_(rays, others)] = traces[np.ix_(others, rays)].T


def _signs(
    groups: tuple[ObservationGroup, ...], part: Part, count: int, random: np.random.Generator
) -> tuple[Floats, ...]:
    """Whitened vectors (n, m, count) of the other groups: random signs on one part, zero elsewhere."""
    vectors = tuple(np.zeros((*group.stochastic.present.shape, count)) for group in groups[1:])
    present: Bools = groups[part.group].stochastic.present[part.place]
    signs = random.choice((-1.0, 1.0), (*present.shape, count))
    vectors[part.group - 1][part.place] = np.where(present[:, :, None], signs, 0.0)
    # Of a vector and what it is compared with, each has half of the roots of the shares.
    vectors[part.group - 1][:] *= np.sqrt(_roots(groups[part.group]))[:, :, None]
    return vectors


def _along_derivative(group: ObservationGroup, white: Floats) -> Floats:
    """K z (n, m, d) of whitened vectors of a group."""
    flat = correlation_time.along_derivative(group.stochastic, white.reshape(len(white), -1))
    return flat.reshape(white.shape)


def _roots(group: ObservationGroup) -> Floats:
    """(n, 1) roots of the shares."""
    return np.asarray(np.sqrt(group.stochastic.shares))
