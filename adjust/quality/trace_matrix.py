"""The matrix S of the variance components: traces of products of R = Q_vv P, which are found by probing.

S_gh = tr(R K_g R K_h) with K one on the rows of a part, for a correlation time see
:mod:`adjust.quality.correlation_time`. R is too large to be formed; for z of random signs on part h,
E ‖(R z)_g‖² = S_gh (Hutchinson 1990).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import ObservationGroup
from adjust.quality import correlation_time
from adjust.quality.observation_parts import Part
from adjust.quality.residual_operator import ResidualOperator
from adjust.quality.residual_operator_of_others import ResidualOperatorOfOthers
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import Observations, System

# Σ ‖(R z)_g‖² over so many degrees of freedom pins S_gg to √(2/800) = 5 %, its root to half of that.
_PROBED = 800.0
_MOST_PROBES = 40
# Vectors that are solved for together.
_AT_ONCE = 16


def trace_matrix(system: System, solution: Solution, parts: tuple[Part, ...], redundancy: Floats) -> Floats:
    """S_gh of the parts, (parts, parts), by probing with random signs from a fixed seed.

    Correlated components of an observation are distinguished after whitening. Image points that are one part
    need no probing: what a vector z on another part has there is zᵀ R z without that of the other groups, and
    as R is idempotent, a row of S with all observations sums up to r.

    Parameters
    ----------
    redundancy : (parts,) of the parts; weak parts are probed more often.
    """
    random, traces = np.random.default_rng(0), np.zeros((len(parts), len(parts)))
    number = np.clip(np.ceil(_PROBED / redundancy), 1, _MOST_PROBES).astype(np.int64)
    rays = [k for k, part in enumerate(parts) if part.group == 0]
    others = [k for k, part in enumerate(parts) if part.group > 0]
    whole = [k for k in rays if parts[k].rows is None]
    operator = ResidualOperatorOfOthers.of(system, solution)
    for h in others:
        for count in _portions(int(number[h])):
            of_others, of_rays = _probed_others(operator, system.observations, parts, h, count, random)
            traces[others, h] += of_others[others] / number[h]
            traces[whole, h] += of_rays / number[h]
    traces[np.ix_(others, others)] = _symmetric(traces[np.ix_(others, others)])
    if whole:
        traces[others, whole[0]] = traces[whole[0], others]
        shared = _shared_with_others(operator, system.observations, int(number[whole[0]]), random)
        traces[whole[0], whole[0]] = redundancy[whole[0]] - shared
    elif rays:
        _probe_rays(ResidualOperator.of(system, solution), parts, number, random, traces)
    return traces


def _symmetric(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.T))


def _portions(probes: int) -> Iterator[int]:
    """So many probes, some at a time."""
    for first in range(0, probes, _AT_ONCE):
        yield min(_AT_ONCE, probes - first)


def _probed_others(
    operator: ResidualOperatorOfOthers,
    observations: Observations,
    parts: tuple[Part, ...],
    h: int,
    count: int,
    random: np.random.Generator,
) -> tuple[Floats, float]:
    """Sums of (R z)_g (R K z)_g over vectors z on a part h: (parts,) of the others; and of image points."""
    groups, part = observations.groups, parts[h]
    signs = _signs(groups, part, count, random)
    found = with_signs = operator.residuals(signs)
    own = signs[part.group - 1]
    # zᵀ R K z, which is the sum over all observations.
    if part.is_correlation:
        changed = _along_derivative(groups[part.group], own)
        found = operator.residuals(tuple(changed if one is own else one for one in signs))
    total = float(np.sum(own * found[part.group - 1]))
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
    operator: ResidualOperatorOfOthers, observations: Observations, probes: int, random: np.random.Generator
) -> float:
    """tr(R K_g R K_h) of all image points with all other observations."""
    found = 0.0
    for count in _portions(probes):
        signs = tuple(
            np.where(present[:, :, None], random.choice((-1.0, 1.0), (*present.shape, count)), 0.0)
            for present in (group.stochastic.present for group in observations.others)
        )
        for z, own in zip(signs, operator.residuals(signs), strict=True):
            found += float(np.sum(own * (z - own))) / probes
    return found


def _probe_rays(
    operator: ResidualOperator,
    parts: tuple[Part, ...],
    number: Ints,
    random: np.random.Generator,
    traces: Floats,
) -> None:
    """Fill the rows and columns of image points in several parts."""
    groups = operator.system.observations.groups
    rays = [k for k, part in enumerate(parts) if part.group == 0]
    for h in rays:
        for _ in range(number[h]):
            signs = [np.zeros(group.stochastic.present.shape) for group in groups]
            present = operator.system.observations.image_points.active[parts[h].rows]
            signs[0][parts[h].place] = present[:, None] * random.choice((-1.0, 1.0), (len(present), 2))
            found = operator.residuals(tuple(signs))
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
