"""Approximate orientations of images that were given none, or only a part of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.approximate.image_model import ImageModel, Progress, grown, image_model, model_of
from adjust.approximate.measured_images import MeasuredImages
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
    reach is joined to models, which control points, positions and points of what is placed already place. If
    nothing places anything, the first model stays as it is, with its middle at the origin.
    """
    found, everything = _given(measured, known), np.ones(measured.images, dtype=bool)
    if found.count:
        found = grown(measured, found, everything, progress=progress, surveyed=known.object_point)
    placements = list[Placement]()
    while (left := ~found.oriented).sum() >= 2:
        model = image_model(measured, left, progress)
        if model is None:
            break
        placed = placement(model, known.and_of(found))
        if placed.places == 0 and found.count:
            break
        found = _joined(found, placed.of(model))
        placements.append(placed)
        if placed.places:
            found = grown(measured, found, everything, progress=progress, surveyed=known.object_point)
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


def _joined(one: ImageModel, other: ImageModel) -> ImageModel:
    """Two models of different images in one system."""
    return ImageModel(
        one.oriented | other.oriented,
        np.where(other.oriented[:, None], other.projection_centre, one.projection_centre),
        np.where(other.oriented[:, None, None], other.local_from_camera, one.local_from_camera),
        np.where(np.isfinite(one.object_point), one.object_point, other.object_point),
    )
