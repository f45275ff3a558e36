"""Whether observations are of the block they are to be adjusted with.

The kernels do not look whether an index is in range; they would read foreign memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.geometry import rotation
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import BORESIGHT, SystemParameters
from adjust.rig import RELATIVE_ROTATION, Rig
from adjust.solve.joined_points import joined_points

if TYPE_CHECKING:
    from adjust.solve.system import Observations

# Image coordinates beyond so many half formats are in pixels or millimetres.
_MOST_HALF_FORMATS = 10.0
# A known angle that changes by less than this part of a rotation does not determine it.
_LEVERAGE = 0.01


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
    half = max((max(camera.half_format) for camera in block.cameras), default=np.inf)
    farthest = np.abs(rays.xy).max(initial=0.0)
    if farthest > _MOST_HALF_FORMATS * half:
        raise InconsistentBlockError(
            f"An image coordinate is {farthest:.6g}, and half the side of the largest image {half:.6g} m: "
            "image coordinates are in metres from the centre of the format (FrameCamera.image_from_pixel)."
        )


def _refuse_outside(group: str, kind: str, index: Ints, count: int, least: int = 0) -> None:
    if index.size and not (index.min() >= least and index.max() < count):
        raise InconsistentBlockError(
            f"An observation of {group} has an index of its {kind} outside 0 … {count - 1}."
        )


def refuse_open_platforms(block: Block, observations: Observations) -> None:
    """Refuse platforms without pictures whose own rotation nothing tells from a common one of their heads.

    Known positions of the heads would hide it behind pivots that look sound: a degree is known from them.

    Raises
    ------
    DatumDefectError : with the parameters.
    """
    if block.rig is None:
        return
    given = {parameters.family.name: parameters for parameters in block.system}
    of_heads, boresight = given[RELATIVE_ROTATION], given[BORESIGHT]
    open_heads = of_heads.free & ~_observed(of_heads, observations)
    open_boresight = boresight.free & ~_observed(boresight, observations)
    for platform in np.setdiff1d(block.rig.reference, block.rig.camera_of_image):
        heads = _heads_with_pictures(block.rig, int(platform))
        is_seen = any(
            isinstance(group, InsAttitudes) and group.stochastic.present[group.camera == platform].any()
            for group in observations.others
        )
        of_turn, of_own = _turned_heads(of_heads.values[heads]), _turned_body(boresight.values[platform])
        known = [of_turn[~open_heads[heads]], *([of_own[~open_boresight[platform]]] if is_seen else [])]
        turns = _unseen(np.concatenate(known))
        if not (len(heads) and turns.size):
            continue
        name = block.cameras[platform].name
        moved, own = (np.abs(part @ turns).max(axis=-1) > _LEVERAGE for part in (of_turn, of_own))
        places = [(boresight, platform, k) for k in np.flatnonzero(own & boresight.free[platform])]
        places += [(of_heads, heads[h], k) for h, k in np.argwhere(moved & open_heads[heads])]
        named = tuple(str(family.quantity(int(entity), int(axis))) for family, entity, axis in places)
        why = "its boresight and a common rotation of all its heads are one and the same"
        if not is_seen:
            why = "and nothing observes its attitude: a common rotation of all its heads is not determined"
        sentence = f"{name} takes no pictures{':' if is_seen else ','} {why}."
        raise DatumDefectError(turns.shape[1], named, (sentence,))


def _turned_heads(angles: Floats) -> Floats:
    """Change (h, 3, 3) of the relative rotations (h, 3) of heads by a small turn g of their platform.

    R(ρ) becomes exp(−g) R(ρ), so E(ρ) dρ = −g.
    """
    return np.asarray(-np.linalg.inv(rotation.roll_pitch_yaw_jacobian(angles)))


def _turned_body(angles: Floats) -> Floats:
    """Change (3, 3) of the boresight (3,) by the same: R(b) becomes R(b) exp(g), so E(b) db = R(b) g."""
    turn = rotation.from_roll_pitch_yaw(angles)
    return np.asarray(np.linalg.solve(rotation.roll_pitch_yaw_jacobian(angles), turn))


def _unseen(known: Floats) -> Floats:
    """Turns (3, d) that change known angles, (r, 3) by a turn, by a small part of themselves at most."""
    values, turns = np.linalg.eigh(known.T @ known)
    return np.asarray(turns[:, values < _LEVERAGE**2])


def _heads_with_pictures(rig: Rig, platform: int) -> Ints:
    """Heads of a platform that take pictures."""
    return np.intersect1d(np.flatnonzero(rig.reference == platform), rig.camera_of_image)


def _observed(parameters: SystemParameters, observations: Observations) -> Bools:
    """Which parameters (e, d) of a family are observed."""
    found = np.zeros_like(parameters.free)
    for group in observations.others:
        if isinstance(group, DirectObservations) and group.family == parameters.family:
            found[group.entity] |= group.stochastic.present
        elif isinstance(group, JointPrior):
            for place in group.places:
                if place.family == parameters.family.name:
                    found[place.entity, place.component] = True
    return found
