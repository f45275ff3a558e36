"""All mistakes of the orientations of a delivery at once, by how far the rays of tie points miss each other.

Hypotheses are tried one after the other; the one that explains the misses is taken for corrected, and what is
then left is looked at again. Two mistakes that hide each other are tried in pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from adjust.arrays import Bools, Floats, order_of_numbers
from adjust.parameters import State
from tasks.plausibility.declared_accuracy import TieLimits
from tasks.plausibility.hypotheses import with_orientations_of
from tasks.plausibility.mistake import NO_USUAL_SLIP, Mistake
from tasks.plausibility.orientation_slips import Delivered, Slip
from tasks.plausibility.ray_residuals import ray_residuals, renumbered, sample_of_rays, worst_camera

# A hypothesis is taken when it brings the misses this many times down.
_MARGIN = 3.0
_MOST_MISTAKES = 4
_MOST_SHOWN = 3
# Points of the sample in which pairs of hypotheses are tried.
_POINTS = 400
# Images that stand out, tried in pairs as exchanged.
_SUSPECTS = 8


@dataclass(frozen=True, eq=False)
class TieDiagnosis:
    """What the tie points indicate.

    Attributes
    ----------
    delivered : as it would be with all mistakes corrected.
    mistakes : what was found.
    left_px : median miss with them corrected.
    """

    delivered: Delivered
    mistakes: tuple[Mistake, ...]
    left_px: float


@dataclass(frozen=True, eq=False)
class TieMisses:
    """How far rays miss each other, for any reading of a delivery.

    Attributes
    ----------
    state : of the block; its orientations are those of the reading.
    """

    state: State

    def of(self, delivered: Delivered) -> float:
        """Largest median over the cameras, px; infinite where most rays do not intersect."""
        return worst_camera(delivered.given, delivered.rays, self.residuals(delivered))

    def of_images(self, delivered: Delivered) -> Floats:
        """(n,) median of each image, px."""
        rays, points = delivered.rays, _points(delivered)
        found = self.residuals(delivered)
        length = np.hypot(found[:, 0], found[:, 1])
        several = np.bincount(rays.point, minlength=points)[rays.point] >= 2
        image, length = rays.image[several], np.where(np.isfinite(length), length, np.inf)[several]
        order = order_of_numbers(image)
        own = np.split(length[order], np.searchsorted(image[order], np.arange(1, len(delivered.given.image))))
        return np.array([np.median(one) if len(one) else 0.0 for one in own])

    def residuals(self, delivered: Delivered) -> Floats:
        """(rays, 2) px, NaN where the rays of a point do not intersect."""
        state, pixel_size = delivered.state(self.state), delivered.given.pixel_size
        return ray_residuals(delivered.rays, state, _points(delivered), pixel_size).residual_px


def _points(delivered: Delivered) -> int:
    return int(delivered.rays.point.max()) + 1 if len(delivered.rays.point) else 0


def diagnosed(
    delivered: Delivered, misses: TieMisses, hypotheses: Sequence[Slip], limits: TieLimits
) -> TieDiagnosis:
    """Mistakes that explain how far the rays miss each other.

    Parameters
    ----------
    delivered : as declared.
    limits : above which an explanation is looked for.
    """
    mistakes: list[Mistake] = []
    sample = replace(delivered, rays=sample_of_rays(delivered.rays, int(delivered.rays.point.max()) + 1))
    now = misses.of(sample)
    done: list[Slip] = []
    while now > limits.suspicious_px and len(mistakes) < _MOST_MISTAKES:
        found = _explaining(sample, misses, hypotheses, now, limits)
        if not found:
            break
        for mistake, hypothesis in found:
            mistakes.append(mistake)
            done.append(hypothesis)
            sample = hypothesis.corrected(sample)
        left = misses.of(sample)
        if not left < now:
            break
        now = left
    for hypothesis in done:
        delivered = hypothesis.corrected(delivered)
    return TieDiagnosis(delivered, tuple(mistakes), now)


def _explaining(
    sample: Delivered,
    misses: TieMisses,
    hypotheses: Sequence[Slip],
    now: float,
    limits: TieLimits,
) -> list[tuple[Mistake, Slip]]:
    """The hypothesis, or the pair of them, that explains the misses; empty if nothing does."""
    trials = sorted(((misses.of(h.corrected(sample)), k) for k, h in enumerate(hypotheses)))
    best = trials[0][0]
    if best <= limits.suspicious_px and best * _MARGIN < now:
        return [_single(trials, hypotheses, now)]
    small = _smaller(sample)
    pairs = []
    for one, other in combinations(hypotheses, 2):
        if one.kind and one.kind == other.kind:
            continue
        pairs.append((misses.of(other.corrected(one.corrected(small))), one, other))
    left, one, other = min(pairs, key=lambda pair: pair[0])
    if left * _MARGIN < min(now, best) and left <= limits.wrong_px:
        evidence = (f"{_px(left)} if both are corrected", *_evidence(trials[:1], hypotheses), _as_is(now))
        return [(Mistake(f"{one.looks_like}.", evidence, one.remedy, one.declare), one),
                (Mistake(f"{other.looks_like}.", evidence, other.remedy, other.declare), other)]  # fmt: skip
    return [_single(trials, hypotheses, now)] if best * _MARGIN < now and best <= limits.wrong_px else []


def _single(
    trials: Sequence[tuple[float, int]], hypotheses: Sequence[Slip], now: float
) -> tuple[Mistake, Slip]:
    """The best hypothesis, and next to it one that explains the misses as well."""
    best, first = trials[0]
    chosen = hypotheses[first]
    alike = [
        hypotheses[k]
        for left, k in trials[1:]
        if left <= best * _MARGIN and not (chosen.kind and hypotheses[k].kind == chosen.kind)
    ]
    also = f" {alike[0].looks_like} just as well." if len(alike) == 1 else ""
    remedy = f"{chosen.remedy} Or: {alike[0].remedy}" if len(alike) == 1 else chosen.remedy
    evidence = (*_evidence(trials[:_MOST_SHOWN], hypotheses), _as_is(now))
    return Mistake(f"{chosen.looks_like}.{also}", evidence, remedy, chosen.declare), chosen


def _evidence(trials: Sequence[tuple[float, int]], hypotheses: Sequence[Slip]) -> tuple[str, ...]:
    return tuple(
        f"{_px(left)}: {hypotheses[k].looks_like[0].lower()}{hypotheses[k].looks_like[1:]}"
        for left, k in trials
    )


def _as_is(now: float) -> str:
    return f"{_px(now)}: as declared"


def _px(value: float) -> str:
    return f"{value:.1f} px" if np.isfinite(value) else "no intersection"


def _smaller(sample: Delivered) -> Delivered:
    """A sample of the points with the most rays."""
    count = np.bincount(sample.rays.point, minlength=_points(sample))
    chosen = np.zeros(len(count), dtype=bool)
    chosen[np.argsort(-count, kind="stable")[:_POINTS]] = True
    return _with_points(sample, chosen)


def _with_points(delivered: Delivered, chosen: Bools) -> Delivered:
    """The rays of the chosen points (m,), renumbered."""
    return replace(
        delivered, rays=renumbered(delivered.rays, chosen[delivered.rays.point], np.cumsum(chosen) - 1)
    )


def unexplained(left_px: float, limits: TieLimits) -> Mistake:
    """Misses that no hypothesis explains, and that are too small to refuse anything."""
    what = (
        f"The rays of tie points miss each other by {_px(left_px)} (median) with the given orientations; "
        f"up to {limits.suspicious_px:.1f} px could be explained by the stated σ."
    )
    return Mistake(what, (), NO_USUAL_SLIP)


def exchanged_images(delivered: Delivered, misses: TieMisses, limits: TieLimits) -> list[Mistake]:
    """Pairs of images of which each has the orientation of the other."""
    found: list[Mistake] = []
    names = delivered.given.image
    while len(found) < _MOST_MISTAKES:
        medians = misses.of_images(delivered)
        suspects = [
            int(i) for i in np.argsort(-medians, kind="stable")[:_SUSPECTS] if medians[i] > limits.wrong_px
        ]
        if len(suspects) < 2:
            break
        # Only the points that they see tell whether they are exchanged.
        seen = np.zeros(_points(delivered), dtype=bool)
        seen[delivered.rays.point[np.isin(delivered.rays.image, suspects)]] = True
        near = _with_points(delivered, seen)
        trials = []
        for i, j in combinations(suspects, 2):
            order = np.arange(len(names))
            order[[i, j]] = j, i
            other = with_orientations_of(delivered.given, order)
            after = misses.of_images(replace(near, given=other))
            trials.append((float(max(after[i], after[j])), i, j, other))
        left, i, j, other = min(trials, key=lambda trial: trial[0])
        if left > limits.suspicious_px or left * _MARGIN > min(medians[i], medians[j]):
            break
        found.append(
            Mistake(
                f"The exposures of the images {names[i]} and {names[j]} look mixed up.",
                (
                    f"{_px(left)}: exchanged",
                    f"{_px(float(medians[i]))} and {_px(float(medians[j]))}: as delivered",
                ),
                f"Exchange the names {names[i]} and {names[j]} in the file of the exposures.",
            )
        )
        delivered = replace(delivered, given=other)
    return found
