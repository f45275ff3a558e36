"""Approximate orientations of images that were given none, or only a part of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.approximate.image_model import ImageModel, Progress, begun_models, grown, image_model, model_of
from adjust.approximate.measured_images import LIMITS_PX, MeasuredImages
from adjust.approximate.placement import KnownPlaces, Placement, placement
from adjust.arrays import Bools


@dataclass(frozen=True, eq=False)
class FoundOrientations:
    """Orientations of images, in the system of the known places.

    Attributes
    ----------
    model : the images that could be oriented, those given among them.
    placements : of the models that were placed as a whole; none where given orientations carry all of them.
    """

    model: ImageModel
    placements: tuple[Placement, ...]


def find_orientations(
    measured: MeasuredImages, known: KnownPlaces, progress: Progress | None = None
) -> FoundOrientations:
    """Orient all images that image points connect to known positions, or to each other.

    From images with position and attitude the others are resected one after the other. What these do not
    reach is joined to models, which control points, positions, and what is placed already place. If nothing
    places anything, the first model stays as it is, with its middle at the origin.
    """
    found, everything = _given(measured, known), np.ones(measured.images, dtype=bool)
    if found.count:
        found = grown(measured, found, everything, progress=progress, surveyed=known.object_point)
    placements = list[Placement]()
    while not found.oriented.all():
        following = _next_model(measured, known, found, progress)
        if following is None:
            break
        model, placed = following
        found = _joined(found, placed.of(model))
        placements.append(placed)
        if placed.places:
            surveyed = known.object_point if placements[0].turned else None
            found = grown(measured, found, everything, progress=progress, surveyed=surveyed)
    if placements and not placements[0].turned:
        # What was joined to the first model may say how it is turned.
        again = placement(found, known)
        if again.turned:
            found, placements[0] = again.of(found), again
    if not found.oriented.all() and all(item.places for item in placements):
        found = grown(measured, found, everything, progress=progress, surveyed=known.object_point)
    return FoundOrientations(found, tuple(placements))


def _given(measured: MeasuredImages, known: KnownPlaces) -> ImageModel:
    """The images with position and attitude, straightened by what they have in common."""
    given: Bools = np.asarray(np.isfinite(known.projection_centre).all(axis=1))
    given &= np.isfinite(known.local_from_camera).all(axis=(1, 2))
    centre = np.where(given[:, None], known.projection_centre, 0.0)
    rotation = np.where(given[:, None, None], known.local_from_camera, np.eye(3))
    return model_of(measured, given, centre, rotation)


def _next_model(
    measured: MeasuredImages, known: KnownPlaces, found: ImageModel, progress: Progress | None
) -> tuple[ImageModel, Placement] | None:
    """A model of images that are not placed yet, and its placement; None if there is none that can be placed.

    It begins with an image that is placed and one that is not, if common points allow it: a chain of images
    may have too few of them for resections.
    """
    left = ~found.oriented
    if found.count:
        for model in begun_models(measured, np.ones_like(left), (left, found.oriented)):
            placed = placement(model, known.only_of(found))
            if _agrees(measured, placed.of(model), found):
                return model, placed
    whole = image_model(measured, left, progress)
    if whole is None:
        return None
    placed = placement(whole, known.and_of(found))
    return None if found.count and not (placed.places and placed.scaled) else (whole, placed)


def _agrees(measured: MeasuredImages, placed: ImageModel, found: ImageModel) -> bool:
    """Whether the images that were not placed before see points of the others where these are."""
    rays = measured.rays
    state = measured.state(
        placed.projection_centre, placed.local_from_camera, np.nan_to_num(found.object_point)
    )
    new = (placed.oriented & ~found.oriented)[rays.image]
    known: Bools = np.asarray(np.isfinite(found.object_point).all(axis=1))
    rows = new & known[rays.point]
    return bool(rows.any() and np.median(measured.residual_px(state)[rows]) <= LIMITS_PX[-1])


def _joined(one: ImageModel, other: ImageModel) -> ImageModel:
    """Two models in one system; images of both stay as they are in the first."""
    return ImageModel(
        one.oriented | other.oriented,
        np.where(one.oriented[:, None], one.projection_centre, other.projection_centre),
        np.where(one.oriented[:, None, None], one.local_from_camera, other.local_from_camera),
        np.where(np.isfinite(one.object_point), one.object_point, other.object_point),
    )
