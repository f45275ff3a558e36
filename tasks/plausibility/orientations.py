"""Whether the given orientations fit the tie points, and if not, which slip would explain it.

The rays of tie points are intersected with the orientations as given. With a correct input they
miss each other by little more than the accuracy of the GNSS/INS; a wrong unit, angle order, matrix
direction or axis makes them miss by hundreds of pixels. Then the common mistakes are tried one after the
other, and one that explains the data, three times better than any other, is named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import GivenOrientations
from tasks.errors import InputError
from tasks.plausibility.declared_accuracy import TieLimits
from tasks.plausibility.diagnosis import TieMisses
from tasks.plausibility.hypotheses import of_orientations
from tasks.plausibility.mistake import NO_USUAL_SLIP
from tasks.plausibility.orientation_slips import Delivered, Slip, usual_slips
from tasks.plausibility.ray_residuals import (
    RayResiduals,
    ray_residuals,
    renumbered,
    sample_of_rays,
    worst_camera,
)
from tasks.plausibility.tie_mistakes import tie_mistakes

# A mistake is named when it brings the median residual below the limit and this many times below others.
_MARGIN = 3.0
# So many slips that explain it alike are named.
_MOST_ALIKE = 2
# Images tried as the one that contradicts the others.
_SUSPECTS = 8


def check_orientations(
    given: GivenOrientations,
    rays: ImagePoints,
    state: State,
    points: int,
    limits: TieLimits,
    found: RayResiduals,
) -> list[str]:
    """Refuse orientations that contradict the tie points, naming the mistake that explains it.

    Parameters
    ----------
    found : how far the rays miss each other as they are.

    Returns
    -------
    problems : a mistake that explains residuals which are not large enough to refuse anything.

    Raises
    ------
    InputError
        If all orientations are wrong in one way, those of one camera are, or single images contradict their
        neighbours.
    """
    worst_px = max(found.median_px, worst_camera(given, rays, found.residual_px))
    if worst_px <= limits.suspicious_px:
        _check_single_images(given, rays, state, points, limits, found)
        return []
    slips, left_px = best_slips(given, sample_of_rays(rays, points), state, worst_px)
    if worst_px <= limits.wrong_px and (not slips or left_px > limits.suspicious_px):
        _check_single_images(given, rays, state, points, limits, found)
        return []
    if worst_px > limits.wrong_px:
        if not slips and found.median_px <= limits.wrong_px:
            _check_single_images(given, rays, state, points, limits, found)
        explaining = slips if left_px <= limits.wrong_px else ()
        refusal = _refusal(worst_px, limits.wrong_px, limits.because, explaining, left_px)
        raise refusal if explaining else _explained(refusal, given, rays, state, limits)
    refusal = _refusal(worst_px, limits.suspicious_px, "", slips, left_px)
    try:
        _check_single_images(given, rays, state, points, limits, found)
    except InputError as error:
        # Images that stand out most are not to blame for what all of them show.
        raise refusal from error
    return [str(refusal)]


def best_slips(
    given: GivenOrientations, sample: ImagePoints, state: State, now_px: float
) -> tuple[tuple[Slip, ...], float]:
    """The slips that explain the residuals clearly better than all others, best first; what is left, px.

    Several explain them where their effects are alike; more than two say nothing.
    """
    points = int(sample.point.max()) + 1
    trials = []
    for slip in usual_slips(given):
        read = _corrected(slip, given, sample, state)
        trials.append((ray_residuals(*read, points, given.pixel_size).median_px, slip))
    trials.sort(key=lambda item: item[0])
    best_px = trials[0][0]
    if best_px * _MARGIN >= now_px:
        return (), best_px
    alike: list[Slip] = []
    for left_px, slip in trials:
        same = any(slip.kind and slip.kind == other.kind for other in alike)
        if left_px <= best_px * _MARGIN and not same:
            alike.append(slip)
    return (tuple(alike) if len(alike) <= _MOST_ALIKE else ()), best_px


def _corrected(
    slip: Slip, given: GivenOrientations, rays: ImagePoints, state: State
) -> tuple[ImagePoints, State]:
    """Image points and state as they are if a mistake was made."""
    read = slip.corrected(Delivered(given, rays))
    return read.rays, read.state(state)


def _refusal(
    now_px: float, limit_px: float, because: str, slips: tuple[Slip, ...], left_px: float
) -> InputError:
    """The error that names the most likely slip or slips, or says that none of the usual ones explains it."""
    miss = (
        f"The rays of tie points miss each other by {_px(now_px)} (median) with the given orientations; "
        f"up to {limit_px:.0f} px could be explained{f' {because}' if because else ''}."
    )
    if slips:
        first, *others = slips
        also = "".join(f" {other.looks_like} just as well." for other in others)
        remedy = " Or: ".join(slip.remedy for slip in slips)
        return InputError(f"{miss} {first.looks_like}: then it is {_px(left_px)}.{also}", remedy)
    return InputError(miss, NO_USUAL_SLIP)


def _px(value: float) -> str:
    return f"{value:.1f} px" if np.isfinite(value) else "more than the format"


def _check_single_images(
    given: GivenOrientations,
    rays: ImagePoints,
    state: State,
    points: int,
    limits: TieLimits,
    found: RayResiduals,
) -> None:
    """Name images whose orientation contradicts that of their neighbours.

    Images are left out, each time the one without which the others agree best, until they do; what was
    left out is then compared with the points intersected from the others. Those that are known less well than
    the others, such as from the track, contradict nobody.
    """
    left_out: list[int] = []
    limit_px, pixel = limits.wrong_px, given.pixel_size
    kept = np.asarray((limits.of_image_px <= limit_px)[rays.image])
    number = np.arange(points)
    if kept.all():
        medians = _medians(rays, found, points, len(given.image))
    else:
        medians = _medians_of(renumbered(rays, kept, number), state, points, pixel)
    while len(left_out) <= max(1, len(given.image) // 5):
        if medians.max() <= limit_px:
            break
        suspects = [int(i) for i in np.argsort(-medians, kind="stable")[:_SUSPECTS] if medians[i] > limit_px]
        without = [
            _medians_of(renumbered(rays, kept & (rays.image != i), number), state, points, pixel)
            for i in suspects
        ]
        best = int(np.argmin([np.sum(np.minimum(m, 1e3 * limit_px)) for m in without]))
        left_out.append(suspects[best])
        kept &= rays.image != suspects[best]
        medians = without[best]
    if not left_out:
        return
    points_of_others = intersect(renumbered(rays, kept, number), state, points)
    trusted = replace(state, object_point=points_of_others.object_point)
    image = left_out[0]
    own = (rays.image == image) & points_of_others.usable[rays.point]
    own_rays = renumbered(rays, own, number)
    others = f" ({len(left_out)} images in all: {', '.join(given.image[i] for i in left_out)})"
    suffix = others if len(left_out) > 1 else ""
    now = _median_length(own_rays, trusted, pixel)
    what = f"Its given orientation misses the points of its neighbours by {_px(now)}{suffix}."
    for quarter in (1, 2, 3):
        turn = np.round(rotation.about_z(quarter * np.pi / 2.0))
        turned = replace(trusted, local_from_camera=trusted.local_from_camera @ turn)
        if _median_length(own_rays, turned, pixel) < max(limit_px, now / 50.0):
            raise InputError(
                f"{what} Its κ looks rotated by {90 * quarter}°.",
                "Correct κ of this image (or which way up it was measured).",
                entity=f"image {given.image[image]}",
            )
    for slip in usual_slips(given):
        # What is wrong in all images may show in those with large tilts only.
        if _medians_of(*_corrected(slip, given, rays, state), points, pixel).max() <= limit_px:
            raise InputError(
                f"{what} {slip.looks_like}: then all images fit.",
                slip.remedy,
                entity=f"image {given.image[image]}",
            )
    refusal = InputError(
        what, "Check its position, its angles, and whether its image points are its own.",
        entity=f"image {given.image[image]}",
    )  # fmt: skip
    raise _explained(refusal, given, rays, state, limits)


def _explained(
    refusal: InputError, given: GivenOrientations, rays: ImagePoints, state: State, limits: TieLimits
) -> InputError:
    """The refusal with what the doctor would find; the same where that is nothing."""
    found = tie_mistakes(
        Delivered(given, rays), TieMisses(state), of_orientations(given, ()), limits
    ).mistakes
    if not found:
        return refusal
    shown = (f"{mistake.what.rstrip('.')} ({'; '.join(mistake.evidence)})." for mistake in found)
    remedy = " ".join(dict.fromkeys(mistake.remedy for mistake in found))
    return InputError(" ".join((refusal.what, *shown)), remedy, refusal.file, entity=refusal.entity)


def _medians_of(rays: ImagePoints, state: State, points: int, pixel: Floats) -> Floats:
    """Median residual length of every image with these rays alone."""
    return _medians(rays, ray_residuals(rays, state, points, pixel), points, len(pixel))


def _medians(rays: ImagePoints, found: RayResiduals, points: int, images: int) -> Floats:
    """Median residual length of every image, 0 for one without usable rays."""
    residual = found.residual_px
    length = np.hypot(residual[:, 0], residual[:, 1])
    several = np.bincount(rays.point, minlength=points)[rays.point] >= 2
    # A point that could not be intersected speaks against its images as a large residual does.
    length = np.where(np.isfinite(length), length, 1e9)
    image, length = rays.image[several], length[several]
    # By length, then by image with that order kept: small numbers are sorted by their digits.
    order = np.argsort(length)
    length = length[order[np.argsort(image[order].astype(np.min_scalar_type(images)), kind="stable")]]
    count = np.bincount(image, minlength=images)
    seen = np.flatnonzero(count)
    first, count = (np.cumsum(count) - count)[seen], count[seen]
    medians = np.zeros(images)
    medians[seen] = 0.5 * (length[first + (count - 1) // 2] + length[first + count // 2])
    return medians


def _median_length(rays: ImagePoints, state: State, pixel: Floats) -> float:
    """Median distance in pixels of image points from the projections of the state's object points."""
    misclosure = rays.misclosure(state) / pixel[rays.image][:, None]
    length = np.hypot(misclosure[:, 0], misclosure[:, 1])
    return float(np.median(np.where(np.isfinite(length), length, np.inf))) if len(length) else float("inf")
