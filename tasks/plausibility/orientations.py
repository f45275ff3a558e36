"""Whether the given orientations fit the tie points, and which slip would explain it if not.

The rays of tie points are intersected with the orientations as given. With a correct input they
miss each other by little more than the accuracy of the GNSS/INS; a wrong unit, angle order, matrix
direction or axis makes them miss by hundreds of pixels. Then the usual slips are tried one after the
other, and one that explains the data, three times better than any other, is named.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from adjust.approximate.intersection import intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import AngleOrder, GivenOrientations
from tasks.errors import InputError
from tasks.settings.quality import ChecksSettings

# A slip is named when it brings the median residual below the limit and this many times below others.
_MARGIN = 3.0
# Residuals expected from the declared sigmas are allowed this many times over.
_ALLOWANCE = 10.0
# Images tried as the one that contradicts the others.
_SUSPECTS = 8
# Rays used to try slips: enough for a median, few enough to be instant.
_TRIAL_POINTS = 3000


@dataclass(frozen=True, eq=False)
class RayResiduals:
    """How far the rays of tie points miss each other with given orientations.

    Attributes
    ----------
    residual_px : (n, 2) column, row; NaN where the point could not be intersected.
    median_px : median length over all image points; infinite if most could not be intersected.
    """

    residual_px: Floats
    median_px: float


Reading: TypeAlias = tuple[GivenOrientations, ImagePoints, AngleOrder, Floats]


@dataclass(frozen=True)
class Slip:
    """One usual slip.

    Attributes
    ----------
    looks_like : what it would be.
    remedy : what to do.
    corrected : the input as it should have been read: orientations, image points, the order of the
        angles, and a turn (3, 3) of the camera to be applied last.
    """

    looks_like: str
    remedy: str
    corrected: Callable[[GivenOrientations, ImagePoints], Reading]


def ray_residuals(rays: ImagePoints, state: State, points: int, pixel_size: Floats) -> RayResiduals:
    """Residuals at the intersections of the rays of ``points`` object points.

    Parameters
    ----------
    pixel_size : (images,) metres.
    """
    intersection = intersect(rays, state, points)
    misclosure = rays.misclosure(replace(state, object_point=intersection.object_point))
    misclosure[~intersection.usable[rays.point]] = np.nan
    residual_px = -misclosure / pixel_size[rays.image][:, None] * np.array([1.0, -1.0])
    length = np.hypot(residual_px[:, 0], residual_px[:, 1])
    several = np.bincount(rays.point, minlength=points)[rays.point] >= 2
    length = np.where(np.isfinite(length), length, np.inf)[several]
    return RayResiduals(residual_px, float(np.median(length)) if len(length) else 0.0)


def tie_limit_px(given: GivenOrientations, checks: ChecksSettings, height: float) -> float:
    """Median residual above which the orientations are called wrong, from settings and declared sigmas.

    Parameters
    ----------
    height : flying height above the intersected points, metres. Wrong orientations can make it anything,
        so the distance between neighbouring exposures, which is always smaller, bounds it from below.
    """
    cameras = given.mountings.cameras
    scale = np.array([camera.focal_length / camera.pixel_size for camera in cameras])[given.camera]
    attitude = np.nan_to_num(given.angle_sigma).max(axis=1)
    position = np.nan_to_num(given.position_sigma).max(axis=1) / max(height, _spacing(given), 1.0)
    expected = float(np.median(scale * np.hypot(attitude, position)))
    return max(checks.tie_residual_px, _ALLOWANCE * expected)


def control_limit_m(given: GivenOrientations, checks: ChecksSettings, height: float) -> float:
    """Distance of a control point from its intersection above which it is called wrong, metres.

    Attitudes of σ move an intersection by about h σ in plan and three times that in height (a usual
    ratio of height and base); attitudes taken from the track are no reason to doubt the control.
    """
    attitude = float(np.median(np.nan_to_num(given.angle_sigma).max(axis=1)))
    position = float(np.median(np.nan_to_num(given.position_sigma).max(axis=1)))
    return max(checks.control_distance_m, _ALLOWANCE * 3.0 * (position + height * attitude))


def _spacing(given: GivenOrientations) -> float:
    """Median distance of an exposure to the nearest one that is not at the same place, metres."""
    plan = given.observed[:, :2]
    if len(plan) < 2:
        return 0.0
    distance = np.asarray(cKDTree(plan).query(plan, k=min(len(plan), 4))[0])
    apart = np.where(distance[:, 1:] > 1.0, distance[:, 1:], np.inf).min(axis=1)
    return float(np.median(apart)) if np.isfinite(apart).all() else 0.0


def check_orientations(
    given: GivenOrientations, rays: ImagePoints, state: State, points: int, limit_px: float
) -> None:
    """Refuse orientations that contradict the tie points, naming the slip that explains it.

    Raises
    ------
    InputError
        If all orientations are wrong in one way, or single images contradict their neighbours.
    """
    pixel_size = np.array([camera.pixel_size for camera in given.mountings.cameras])[given.camera]
    found = ray_residuals(rays, state, points, pixel_size)
    sample = _sample(rays, points)
    if found.median_px > limit_px:
        raise _explained(given, sample, state, limit_px, found.median_px, pixel_size)
    _check_single_images(given, rays, state, points, limit_px, pixel_size)


def _sample(rays: ImagePoints, points: int) -> ImagePoints:
    """Rays of a limited number of points, those with most rays first, renumbered."""
    count = np.bincount(rays.point, minlength=points)
    chosen = np.sort(np.argsort(-count, kind="stable")[:_TRIAL_POINTS])
    number = np.full(points, -1, dtype=np.int64)
    number[chosen] = np.arange(len(chosen))
    return _subset(rays, number[rays.point] >= 0, number)


def _subset(rays: ImagePoints, kept: Bools, number: Ints) -> ImagePoints:
    return ImagePoints(
        rays.image[kept],
        number[rays.point[kept]],
        rays.camera_of_image,
        rays.xy[kept],
        rays.sigma[kept],
        rays.active[kept],
    )


def _explained(
    given: GivenOrientations, sample: ImagePoints, state: State, limit_px: float, now_px: float, pixel: Floats
) -> InputError:
    """The error that names the most likely slip, or says that none of the usual ones explains it."""
    points = int(sample.point.max()) + 1
    trials = []
    for slip in _slips(given):
        orientations, rays, order, turn = slip.corrected(given, sample)
        centre, local_from_camera = orientations.orientations(order)
        trial = replace(state, projection_centre=centre, local_from_camera=local_from_camera @ turn)
        trials.append((ray_residuals(rays, trial, points, pixel).median_px, slip))
    trials.sort(key=lambda item: item[0])
    best_px, best = trials[0]
    what = (
        f"The rays of tie points miss each other by {_px(now_px)} (median) with the given orientations; "
        f"up to {limit_px:.0f} px could be explained."
    )
    if best_px < limit_px and best_px * _MARGIN < min(trials[1][0], now_px):
        return InputError(f"{what} {best.looks_like}: then it is {_px(best_px)}.", best.remedy)
    return InputError(
        what,
        "None of the usual slips (unit, order or reference of the angles, a turned camera, mirrored image "
        "coordinates) explains it: check the focal length, the positions, and whether the image points "
        "belong to these exposures.",
    )


def _px(value: float) -> str:
    return f"{value:.1f} px" if np.isfinite(value) else "more than the format"


_SAME = np.eye(3)


def _slips(given: GivenOrientations) -> list[Slip]:
    """The usual slips."""
    grid = not bool(given.is_heading.all())
    name = "angles.unit"
    slips = [
        _angles("The angles look like gon", f'Declare {name} = "gon" for the exposures.', 0.9),
        _angles("The angles look like degrees", f'Declare {name} = "deg" for the exposures.', 10.0 / 9.0),
        _angles("The angles look like radians", f'Declare {name} = "rad" for the exposures.', 180.0 / np.pi),
        Slip(
            "The image coordinates look mirrored (y down)",
            "Image coordinates count y against the rows (up); change the sign of y, or declare unit px.",
            lambda g, r: (g, replace(r, xy=r.xy * np.array([1.0, -1.0])), "omega-phi-kappa", _SAME),
        ),
        Slip(
            "The columns x and y of the image points look swapped",
            "Swap the two columns, or their names in the header.",
            lambda g, r: (g, replace(r, xy=r.xy[:, ::-1].copy()), "omega-phi-kappa", _SAME),
        ),
        Slip(
            "The rotations look transposed (camera from ground instead of ground from camera)",
            "Export the angles of the rotation from the camera to the ground.",
            lambda g, r: (g, r, "omega-phi-kappa", _transposing(g)),
        ),
    ]
    for quarter in (1, 2, 3):
        turn = np.round(rotation.about_z(quarter * np.pi / 2.0))
        slips.append(
            Slip(
                f"The images look turned by {90 * quarter}° against the given angles",
                "Check which way up the images were measured, κ, and mount_deg if headings are given.",
                lambda g, r, turn=turn: (g, r, "omega-phi-kappa", turn),  # type: ignore[misc]
            )
        )
    if grid:
        slips.append(
            Slip(
                "The angles look like the other order of ω and φ",
                'Declare angles.order = "phi-omega-kappa" instead of "omega-phi-kappa", or the reverse.',
                lambda g, r: (g, r, "phi-omega-kappa", _SAME),
            )
        )
        slips.append(
            Slip(
                "The angles look as if they were counted from true north",
                'Declare angles.reference = "true-north" for the exposures.',
                lambda g, r: (replace(g, local_from_grid=g.local_from_enu), r, "omega-phi-kappa", _SAME),
            )
        )
        slips.append(
            Slip(
                "The angles look as if they were counted from grid north",
                'Declare angles.reference = "grid" for the exposures.',
                lambda g, r: (replace(g, local_from_grid=_once_more(g)), r, "omega-phi-kappa", _SAME),
            )
        )
    return slips


def _once_more(given: GivenOrientations) -> Floats:
    """Axes (n, 3, 3) in which a meridian convergence that was added on import is taken away again."""
    enu_from_grid = np.swapaxes(given.local_from_enu, 1, 2) @ given.local_from_grid
    return np.asarray(given.local_from_grid @ enu_from_grid)


def _angles(looks_like: str, remedy: str, factor: float) -> Slip:
    return Slip(
        looks_like,
        remedy,
        lambda g, r: (replace(g, angles=g.angles * factor), r, "omega-phi-kappa", _SAME),
    )


def _transposing(given: GivenOrientations) -> Floats:
    """Turns (n, 3, 3) that make of each rotation grid from camera its transpose."""
    _, local_from_camera = given.orientations()
    grid_from_camera = np.swapaxes(given.local_from_grid, 1, 2) @ local_from_camera
    transposed = np.swapaxes(grid_from_camera, 1, 2)
    return transposed @ transposed


def _check_single_images(
    given: GivenOrientations, rays: ImagePoints, state: State, points: int, limit_px: float, pixel: Floats
) -> None:
    """Name images whose orientation contradicts that of their neighbours.

    Images are left out, each time the one without which the others agree best, until they do; what was
    left out is then compared with the points intersected from the others.
    """
    left_out: list[int] = []
    kept = np.ones(len(rays.image), dtype=bool)
    number = np.arange(points)
    while len(left_out) <= max(1, len(given.image) // 5):
        medians = _medians(_subset(rays, kept, number), state, points, pixel, len(given.image))
        if medians.max() <= limit_px:
            break
        suspects = [int(i) for i in np.argsort(-medians, kind="stable")[:_SUSPECTS] if medians[i] > limit_px]
        without = [
            _medians(_subset(rays, kept & (rays.image != i), number), state, points, pixel, len(given.image))
            for i in suspects
        ]
        worst = suspects[int(np.argmin([np.sum(np.minimum(m, 1e3 * limit_px)) for m in without]))]
        left_out.append(worst)
        kept &= rays.image != worst
    if not left_out:
        return
    points_of_others = intersect(_subset(rays, kept, number), state, points)
    trusted = replace(state, object_point=points_of_others.object_point)
    image = left_out[0]
    own = (rays.image == image) & points_of_others.usable[rays.point]
    own_rays = _subset(rays, own, number)
    others = f" ({len(left_out)} images in all: {', '.join(given.image[i] for i in left_out)})"
    suffix = others if len(left_out) > 1 else ""
    now = _median_length(own_rays, trusted, pixel)
    what = f"Its given orientation misses the points of its neighbours by {_px(now)}{suffix}."
    for quarter in (1, 2, 3):
        turn = np.round(rotation.about_z(quarter * np.pi / 2.0))
        turned = replace(trusted, local_from_camera=trusted.local_from_camera @ turn)
        if _median_length(own_rays, turned, pixel) < max(limit_px, now / 50.0):
            raise InputError(
                f"{what} Its κ looks turned by {90 * quarter}°.",
                "Correct κ of this image (or which way up it was measured).",
                entity=f"image {given.image[image]}",
            )
    raise InputError(
        what, "Check its position, its angles, and whether its image points are its own.",
        entity=f"image {given.image[image]}",
    )  # fmt: skip


def _medians(rays: ImagePoints, state: State, points: int, pixel: Floats, images: int) -> Floats:
    """Median residual length of every image, 0 for one without usable rays."""
    residual = ray_residuals(rays, state, points, pixel).residual_px
    length = np.hypot(residual[:, 0], residual[:, 1])
    several = np.bincount(rays.point, minlength=points)[rays.point] >= 2
    # A point that could not be intersected speaks against its images as a large residual does.
    length = np.where(np.isfinite(length), length, 1e9)
    order = np.argsort(rays.image[several], kind="stable")
    starts = np.searchsorted(rays.image[several][order], np.arange(images + 1))
    length = length[several][order]
    return np.array(
        [
            np.median(length[starts[i] : starts[i + 1]]) if starts[i + 1] > starts[i] else 0.0
            for i in range(images)
        ]
    )


def _median_length(rays: ImagePoints, state: State, pixel: Floats) -> float:
    """Median distance in pixels of image points from the projections of the state's object points."""
    misclosure = rays.misclosure(state) / pixel[rays.image][:, None]
    length = np.hypot(misclosure[:, 0], misclosure[:, 1])
    return float(np.median(np.where(np.isfinite(length), length, np.inf))) if len(length) else float("inf")
