"""A model of images: oriented to each other by their common points, image after image.

It begins with two images, or with those whose orientation is given. Every round resects the images that see
most of its points, intersects the points they add, and adjusts all of it as a free network.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.image_pair import PairModel, pair_models, pairs_by_common_points
from adjust.approximate.intersection import intersect
from adjust.approximate.measured_images import LIMITS_PX, MeasuredImages
from adjust.approximate.resection import FEWEST, Resection, resect
from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import AdjustmentError
from adjust.geometry.earth import CartesianFrame
from adjust.parameters import FAMILIES, INTERIOR_ORIENTATION, SystemParameters
from adjust.solve.gauss_newton import converge
from adjust.solve.system import Observations, System

Progress = Callable[[int, int], None]

# Rays that meet under less do not carry a resection, radians.
_NARROW = np.deg2rad(1.0)
# An image is added in a round if it sees so large a part of the points that the best one sees.
_AS_GOOD = 0.5
# Pairs that are tried as a beginning, and images each of them must take up to show that it is right.
_BEGINNINGS = 4
_TRIAL_IMAGES = 5
# Iterations of an intermediate adjustment: it need not converge, only straighten the model.
_ITERATIONS = 6


@dataclass(frozen=True, eq=False)
class ImageModel:
    """Images oriented to each other.

    Attributes
    ----------
    oriented : (n,) which images are in it.
    projection_centre : (n, 3), of the others nothing in particular.  local_from_camera : (n, 3, 3).
    object_point : (m, 3) NaN for points that are not in it.
    """

    oriented: Bools
    projection_centre: Floats
    local_from_camera: Floats
    object_point: Floats

    @property
    def count(self) -> int:
        """Number of its images."""
        return int(self.oriented.sum())

    def taking(self, image: int, found: Resection) -> ImageModel:
        """The model with one more image; its points are not yet intersected."""
        oriented, centre = self.oriented.copy(), self.projection_centre.copy()
        rotation = self.local_from_camera.copy()
        oriented[image], centre[image], rotation[image] = (
            True,
            found.projection_centre,
            found.local_from_camera,
        )
        return replace(self, oriented=oriented, projection_centre=centre, local_from_camera=rotation)


def model_of(measured: MeasuredImages, oriented: Bools, centre: Floats, rotation: Floats) -> ImageModel:
    """The model of images that have an orientation, however rough, with their points intersected."""
    model = ImageModel(oriented, centre, rotation, np.full((measured.points, 3), np.nan))
    return _straightened(measured, _intersected(measured, model, np.inf), LIMITS_PX[-1])


def begun_models(
    measured: MeasuredImages, allowed: Bools, pair_of: tuple[Bools, Bools]
) -> Iterator[ImageModel]:
    """Small models of the allowed images (n,), each of another relative orientation, the most worthy first.

    Parameters
    ----------
    pair_of : (n,) images of which one, and (n,) of which the other is in the pair that each begins with.
    """
    for pair in _beginnings(measured, pair_of):
        yield grown(measured, _begun(measured, pair), allowed, most=2 + _TRIAL_IMAGES)


def image_model(
    measured: MeasuredImages, allowed: Bools, progress: Progress | None = None
) -> ImageModel | None:
    """A model of as many connected ones of the allowed images (n,) as possible; None if no two are."""
    measured = measured.only(allowed)
    best: ImageModel | None = None
    best_px = np.inf
    for model in begun_models(measured, allowed, (allowed, allowed)):
        misfit = _misfit_px(measured, model)
        # A wrong solution of a plane object takes up fewer images, or fits them worse.
        if best is None or (-model.count, misfit) < (-best.count, best_px):
            best, best_px = model, misfit
    return None if best is None else grown(measured, best, allowed, progress=progress)


def grown(
    measured: MeasuredImages,
    model: ImageModel,
    allowed: Bools,
    most: int | None = None,
    progress: Progress | None = None,
    surveyed: Floats | None = None,
) -> ImageModel:
    """The model with all the allowed images (n,) that can be resected in it, one after the other.

    Parameters
    ----------
    most : number of images after which it stops.
    progress : called with the images oriented, and those that are to be.
    surveyed : (m, 3) known coordinates, in the axes of the model, of points that it need not have; NaN.
    """
    most = measured.images if most is None else most
    while model.count < most:
        found = _round(measured, model, allowed, surveyed)
        if not found:
            return model
        for image, resection in found[: most - model.count]:
            model = model.taking(image, resection)
        limit = max(resection.limit_px for _, resection in found)
        model = _straightened(measured, _intersected(measured, model, 4.0 * limit), 4.0 * limit)
        if progress is not None:
            progress(model.count, int(allowed.sum()))
    return model


def _round(
    measured: MeasuredImages, model: ImageModel, allowed: Bools, surveyed: Floats | None
) -> list[tuple[int, Resection]]:
    """Images with resections for the next round: those that see most points of the model, best first."""
    points = model.object_point
    if surveyed is not None:
        points = np.where(np.isfinite(points), points, surveyed)
    known: Bools = np.asarray(np.isfinite(points).all(axis=1))
    waiting = np.flatnonzero(allowed & ~model.oriented)
    rows = {
        int(i): measured.rows_of_image[i][known[measured.rays.point[measured.rows_of_image[i]]]]
        for i in waiting
    }
    order = sorted((i for i in rows if len(rows[i]) >= FEWEST), key=lambda i: (-len(rows[i]), i))
    found = list[tuple[int, Resection]]()
    most_seen = 0
    for image in order:
        # Not more than were there: what they see must carry them.
        if len(found) >= max(1, model.count) or len(rows[image]) < _AS_GOOD * most_seen:
            break
        resection = resect(measured, image, rows[image], points[measured.rays.point[rows[image]]])
        if resection is not None:
            found.append((image, resection))
            most_seen = max(most_seen, len(rows[image]))
    return found


def _beginnings(measured: MeasuredImages, pair_of: tuple[Bools, Bools]) -> list[PairModel]:
    """Relative orientations to begin with, the most worthy first."""
    pairs = pairs_by_common_points(measured, *pair_of)
    models = [model for one, other in pairs for model in pair_models(measured, int(one), int(other))]
    models.sort(key=lambda model: -model.worth)
    images = list(dict.fromkeys(model.images for model in models))[:_BEGINNINGS]
    return [model for model in models if model.images in images]


def _begun(measured: MeasuredImages, pair: PairModel) -> ImageModel:
    oriented = np.zeros(measured.images, dtype=bool)
    centre, rotation = np.zeros((measured.images, 3)), np.tile(np.eye(3), (measured.images, 1, 1))
    oriented[list(pair.images)] = True
    centre[pair.images[1]], rotation[pair.images[1]] = pair.projection_centre, pair.rotation
    return model_of(measured, oriented, centre, rotation)


def _intersected(measured: MeasuredImages, model: ImageModel, limit_px: float) -> ImageModel:
    """The model with its points intersected again; those whose rays miss each other by more are not in it."""
    part = measured.only(model.oriented)
    nothing = np.zeros((measured.points, 3))
    found = intersect(
        part.rays, part.state(model.projection_centre, model.local_from_camera, nothing), measured.points
    )
    usable = found.usable & (found.angle > _NARROW)
    state = part.state(
        model.projection_centre, model.local_from_camera, np.where(usable[:, None], found.object_point, 0.0)
    )
    usable[part.rays.point[part.residual_px(state) > limit_px]] = False
    return replace(model, object_point=np.where(usable[:, None], found.object_point, np.nan))


def _misfit_px(measured: MeasuredImages, model: ImageModel) -> float:
    """Median residual of the image points of a model, a point that is not in it counting as infinite."""
    part = measured.only(model.oriented)
    several = np.asarray(np.bincount(part.rays.point, minlength=measured.points) >= 2)[part.rays.point]
    state = part.state(model.projection_centre, model.local_from_camera, np.nan_to_num(model.object_point))
    known = np.asarray(np.isfinite(model.object_point).all(axis=1))[part.rays.point]
    missed = np.where(known, part.residual_px(state), np.inf)[several]
    return float(np.median(missed)) if len(missed) else np.inf


def _straightened(measured: MeasuredImages, model: ImageModel, limit_px: float) -> ImageModel:
    """The model after some iterations of an adjustment as a free network; only intersected if it fails."""
    known: Bools = np.asarray(np.isfinite(model.object_point).all(axis=1))
    rays = measured.rays
    rows: Ints = np.flatnonzero(model.oriented[rays.image] & known[rays.point]).astype(np.int64)
    seen = np.bincount(rays.image[rows], minlength=measured.images)
    taken = model.oriented & (seen >= FEWEST)
    rows = rows[taken[rays.image[rows]]]
    several: Bools = np.asarray(np.bincount(rays.point[rows], minlength=measured.points) >= 2)
    rows = rows[several[rays.point[rows]]]
    if taken.sum() < 2 or len(rows) == 0:
        return _intersected(measured, model, limit_px)
    block, observations = _network(measured, model, taken, rows)
    try:
        system = System.of(block, observations, inner_constraints="both")
        state = converge(system, block.approximate_state(), _ITERATIONS, may_stall=True).state
    except AdjustmentError:
        return _intersected(measured, model, limit_px)
    centre, rotation = model.projection_centre.copy(), model.local_from_camera.copy()
    centre[taken], rotation[taken] = state.projection_centre, state.local_from_camera
    moved = replace(model, projection_centre=centre, local_from_camera=rotation)
    return _intersected(measured, moved, limit_px)


def _network(
    measured: MeasuredImages, model: ImageModel, taken: Bools, rows: Ints
) -> tuple[Block, Observations]:
    """Block and observations of some images (n,) and rays (k,) alone."""
    rays = measured.rays
    images = np.flatnonzero(taken)
    points, point = np.unique(rays.point[rows], return_inverse=True)
    camera = rays.camera_of_image[images]
    own = replace(
        rays.only(rows),
        image=np.searchsorted(images, rays.image[rows]).astype(np.int64),
        point=point.astype(np.int64),
        camera_of_image=camera,
    )
    names = tuple(lens.name for lens in measured.cameras)
    interior = SystemParameters(
        FAMILIES[INTERIOR_ORIENTATION], names, measured.interior, np.zeros((len(names), 3), dtype=bool)
    )
    block = Block(
        CartesianFrame(),
        measured.cameras,
        tuple(str(i) for i in images),
        camera,
        ("",),
        np.zeros(len(images), dtype=np.int64),
        tuple(str(j) for j in points),
        (interior,),
        model.projection_centre[images],
        model.local_from_camera[images],
        model.object_point[points],
    )
    return block, Observations(own, ())
