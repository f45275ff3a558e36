"""Absolute orientation: transforms a model of images into the system of the known positions.

Control points and given positions of images place it; where they lie on one line, given attitudes say how it
is turned about it, or else that the body of the cameras is level. Approximate: antennas are taken for
projection centres.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from adjust.approximate.image_model import ImageModel
from adjust.approximate.similarity import (
    Similarity,
    between_directions,
    mean_rotation,
    on_a_line,
    robustly_fitted,
    turned_about,
)
from adjust.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """Known values in the target system; NaN for unknown ones.

    Attributes
    ----------
    object_point : (m, 3) surveyed coordinates, metres.
    projection_centre : (n, 3) given positions, metres.
    local_from_camera : (n, 3, 3) given attitudes.
    distance_ends : (k, 2) object points between which distances are known.
    distance : (k,) these, metres.
    up_in_camera : (n, 3) direction upwards, axes of the camera, while its body is level; None: opposite to
        that in which it looks.
    """

    object_point: Floats
    projection_centre: Floats
    local_from_camera: Floats
    distance_ends: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    distance: Floats = field(default_factory=lambda: np.zeros(0))
    up_in_camera: Floats | None = None

    def and_of(self, model: ImageModel) -> KnownPlaces:
        """The same, with the points and images of a model that is placed, where they are not known."""

        def known(own: Floats, found: Floats) -> Floats:
            return np.where(np.isfinite(own), own, found)

        oriented = model.oriented[:, None]
        return replace(
            self,
            object_point=known(self.object_point, model.object_point),
            projection_centre=known(
                self.projection_centre, np.where(oriented, model.projection_centre, np.nan)
            ),
            local_from_camera=known(
                self.local_from_camera, np.where(oriented[:, None], model.local_from_camera, np.nan)
            ),
        )

    def only_of(self, model: ImageModel) -> KnownPlaces:
        """The points and images of a model that is placed, and nothing else."""
        own = (self.object_point, self.projection_centre, self.local_from_camera)
        points, centres, rotations = (np.full_like(one, np.nan) for one in own)
        return KnownPlaces(points, centres, rotations).and_of(model)


@dataclass(frozen=True, eq=False)
class Placement:
    """How a model was placed.

    Attributes
    ----------
    similarity : from the model to the known places.
    places : number of control points and positions that agree with it.
    scaled : whether places or distances gave the scale; else it is arbitrary.
    turned : whether places or attitudes gave the rotation; else the body of the cameras was taken as level.
    """

    similarity: Similarity
    places: int
    scaled: bool
    turned: bool

    def of(self, model: ImageModel) -> ImageModel:
        """The model in the system of the known places."""
        return ImageModel(
            model.oriented,
            self.similarity.points(model.projection_centre),
            self.similarity.rotation @ model.local_from_camera,
            self.similarity.points(model.object_point),
        )


def placement(model: ImageModel, known: KnownPlaces) -> Placement:
    """The similarity transformation from a model to the known values, as far as they determine it."""
    source, target = _places(model, known)
    if not on_a_line(source) and not on_a_line(target):
        similarity, agreeing = robustly_fitted(source, target)
        return Placement(similarity, int(agreeing.sum()), scaled=True, turned=True)
    rotation, turned = _rotation(model, known, source, target)
    scale, scaled = _scale(source, target) if len(source) > 1 else _scale_of_distances(model, known)
    if len(source):
        moved = Similarity.about(scale, rotation, source.mean(axis=0), target.mean(axis=0))
    else:
        moved = Similarity.about(scale, rotation, np.nanmean(model.object_point, axis=0), np.zeros(3))
    return Placement(moved, len(source), scaled, turned)


def _places(model: ImageModel, known: KnownPlaces) -> tuple[Floats, Floats]:
    """Points (k, 3) in the model and where they are known to be."""
    points = np.isfinite(model.object_point).all(axis=1) & np.isfinite(known.object_point).all(axis=1)
    images = model.oriented & np.isfinite(known.projection_centre).all(axis=1)
    return (
        np.concatenate([model.object_point[points], model.projection_centre[images]]),
        np.concatenate([known.object_point[points], known.projection_centre[images]]),
    )


def _rotation(model: ImageModel, known: KnownPlaces, source: Floats, target: Floats) -> tuple[Floats, bool]:
    """Rotation from attitudes, else from the line of the places and bodies that are level."""
    images = model.oriented & np.isfinite(known.local_from_camera).all(axis=(1, 2))
    if images.any():
        turns = known.local_from_camera[images] @ np.swapaxes(model.local_from_camera[images], 1, 2)
        return mean_rotation(turns), True
    up = np.array([0.0, 0.0, 1.0])
    upwards = (
        np.broadcast_to(up, (len(model.oriented), 3)) if known.up_in_camera is None else known.up_in_camera
    )
    own = np.einsum("nij,nj->ni", model.local_from_camera, upwards)[model.oriented].mean(axis=0)
    if len(source) < 2:
        return between_directions(own, up), False
    line, goal = _direction(source), _direction(target)
    if (target[-1] - target[0]) @ goal * ((source[-1] - source[0]) @ line) < 0.0:
        goal = -goal
    first = between_directions(line, goal)
    return turned_about(goal, first @ own, up) @ first, False


def _direction(x: Floats) -> Floats:
    """Direction (3,) of the line through points (k, 3), k ≥ 2."""
    return np.asarray(np.linalg.svd(x - x.mean(axis=0))[2][0])


def _scale_of_distances(model: ImageModel, known: KnownPlaces) -> tuple[float, bool]:
    """Scale from known distances between object points; 1 if there are none."""
    one, other = model.object_point[known.distance_ends[:, 0]], model.object_point[known.distance_ends[:, 1]]
    length = np.linalg.norm(one - other, axis=1)
    kept = length > 0.0
    return (float(np.median(known.distance[kept] / length[kept])), True) if kept.any() else (1.0, False)


def _scale(source: Floats, target: Floats) -> tuple[float, bool]:
    """Scale from the distances between places."""
    sizes = [np.linalg.norm(x - x.mean(axis=0)) for x in (target, source)]
    return float(sizes[0] / sizes[1]), True
