"""Whether observations are of the block they are to be adjusted with.

The kernels do not look whether an index is in range; they would read foreign memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Ints, require_shape
from adjust.block import Block
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import InconsistentBlockError
from adjust.observations.base import ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import ADDITIONAL_PARAMETERS
from adjust.solve.consistent_equations import refuse_wrong_equations
from adjust.solve.joined_points import joined_points

if TYPE_CHECKING:
    from adjust.solve.system import Observations

# Image coordinates beyond so many half formats are in pixels or millimetres.
_MOST_HALF_FORMATS = 10.0
# Focal lengths of less or more half formats (a field of view of a quarter of a degree) are in another unit.
_FOCAL_LENGTHS = 0.01, 500.0


def refuse_others_than(block: Block, observations: Observations) -> None:
    """Refuse observations of images, cameras, flights or object points that the block does not have.

    Raises
    ------
    InconsistentBlockError : with the group, and what it lacks.
    """
    if not block.images:
        raise InconsistentBlockError("The block has no images.")
    _refuse_other_rays(block, observations.image_points)
    kind = "image" if block.rig is None else "event"
    entities = {parameters.family.name: len(parameters.entities) for parameters in block.system}
    for group in observations.groups:
        if group is not observations.image_points:
            _refuse_no_group(group)
        name = group.name
        # Only image points must have an object point; −1 elsewhere says that there is none.
        least = 0 if group is observations.image_points else -1
        _refuse_outside(name, "object point", group.point, len(block.points), least)
        _refuse_outside(name, kind, group.event, len(block.events), -1)
        _refuse_outside(name, "object point", np.concatenate(joined_points((group,))), len(block.points))
        if isinstance(group, (GnssPositions, InsAttitudes)):
            _refuse_outside(name, "camera", group.camera, len(block.cameras))
        if isinstance(group, GnssPositions):
            _refuse_outside(name, "flight", group.flight, len(block.flights))
        if isinstance(group, DirectObservations):
            family = group.family
            if family.name not in entities:
                raise InconsistentBlockError(f"{name}: the block has no {family.name}.")
            _refuse_outside(name, family.entity_kind, group.entity, entities[family.name])
        # Types of this package refuse arrays of other shapes, and its tests know their derivatives.
        if not type(group).__module__.startswith("adjust."):
            refuse_wrong_equations(block, block.approximate_state(), group)


def _refuse_no_group(group: object) -> None:
    """Refuse what is no group of observations, or numbers its events and object points with no array."""
    if not isinstance(group, ObservationGroup):
        missing = [name for name in dir(ObservationGroup) if name[0] != "_" and not hasattr(group, name)]
        raise InconsistentBlockError(
            f"A {type(group).__name__} is no group of observations: it has no {', '.join(missing)}."
        )
    for name in ("event", "point"):
        index = getattr(group, name)
        if not isinstance(index, np.ndarray) or index.dtype.kind not in "iu":
            raise InconsistentBlockError(f"{group.name}: {name} is not an array of integers.")


def _refuse_other_rays(block: Block, rays: ImagePoints) -> None:
    _refuse_outside(rays.name, "image", rays.image, len(block.images))
    if not np.array_equal(rays.camera_of_image, block.camera_of_image):
        raise InconsistentBlockError(
            "The image points do not have the same camera of every image as the block."
        )
    known = rays.event_of_image
    if (known is None) != (block.rig is None) or (
        known is not None and not np.array_equal(block.event_of_image, known)
    ):
        raise InconsistentBlockError("The image points do not contain the event of every image of the block.")
    for camera in block.cameras:
        side = max(camera.half_format)
        if not _FOCAL_LENGTHS[0] < camera.focal_length / side < _FOCAL_LENGTHS[1]:
            raise InconsistentBlockError(
                f"The focal length of {camera.name} is {camera.focal_length:.6g}, and half the side of its "
                f"image {side:.6g} m: focal length and pixel size are in metres."
            )
    half = max((max(camera.half_format) for camera in block.cameras), default=np.inf)
    farthest = np.abs(rays.xy).max(initial=0.0)
    if farthest > _MOST_HALF_FORMATS * half:
        raise InconsistentBlockError(
            f"An image coordinate is {farthest:.6g}, and half the side of the largest image {half:.6g} m: "
            "image coordinates are in metres from the centre of the format (FrameCamera.image_from_pixel)."
        )
    if rays.sigma.min(initial=np.inf) > half and len(rays.sigma):
        raise InconsistentBlockError(
            f"The standard deviations of all image coordinates are at least {rays.sigma.min():.6g}, and half "
            f"the side of the largest image {half:.6g} m: they are in metres."
        )


def refuse_other_calibration(block: Block, model: SelfCalibration | None) -> None:
    """Refuse additional parameters whose values and names the block does not have in the same places.

    Raises
    ------
    InconsistentBlockError : with what differs.
    """
    if model is None:
        return
    given = next((item for item in block.system if item.family.name == ADDITIONAL_PARAMETERS), None)
    if given is None:
        raise InconsistentBlockError(
            "The image points have additional parameters, and the block does not. Give their values to the "
            "block as SystemParameters."
        )
    names = given.family.components
    if tuple(model.names) != tuple(names):
        raise InconsistentBlockError(
            f"The additional parameters of the image points are {', '.join(model.names)}; those of the block "
            f"are {', '.join(names)}. They must be the same in the same order."
        )
    entities, index = len(given.entities), np.asarray(model.entity_of_image)
    require_shape("entity_of_image of the additional parameters", index.shape, (len(block.images),))
    if len(model.corrections) != entities or not ((index >= 0) & (index < entities)).all():
        raise InconsistentBlockError(
            f"The block has additional parameters of {entities} cameras; the image points have those of "
            f"{len(model.corrections)}, and their images the indices {index.min()} … {index.max()}."
        )
    number = {camera.name: k for k, camera in enumerate(block.cameras)}
    owner = np.array([number.get(name, -1) for name in given.entities], dtype=np.int64)[index]
    for image in np.flatnonzero((owner >= 0) & (owner != block.camera_of_image)):
        own, other = (block.cameras[camera[image]].name for camera in (block.camera_of_image, owner))
        raise InconsistentBlockError(
            f"Image {block.images[image]} is of the camera {own}, and has the additional parameters of "
            f"{other}."
        )


def _refuse_outside(group: str, kind: str, index: Ints, count: int, least: int = 0) -> None:
    if index.size and not (index.min() >= least and index.max() < count):
        raise InconsistentBlockError(
            f"An observation of {group} has an index of its {kind} outside 0 … {count - 1}."
        )
