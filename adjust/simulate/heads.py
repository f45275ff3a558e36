"""Heads of simulated rigs: where they are said to be, and where they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.rig import RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET, EventMotion, Rig
from adjust.simulate.flight_plan import FlightPlan
from adjust.simulate.trajectory import Trajectory

Triple = tuple[float, float, float]
_ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class HeadSpecification:
    """One head of a rig next to its reference head; metres, radians and seconds, body axes.

    Attributes
    ----------
    camera, reference : indices of its camera and of that of the reference head.
    rotation : roll, pitch, yaw against the reference head, as stated.
    position : against the projection centre of the reference head, as stated.
    synchronisation : how much later than the reference head it is exposed, as stated.
    rotation_change, position_change, synchronisation_change : true minus stated.
    of_platform : the reference head takes no pictures: it stands for the platform of all the heads.
    """

    camera: int
    reference: int
    rotation: Triple = _ZERO
    position: Triple = _ZERO
    synchronisation: float = 0.0
    rotation_change: Triple = _ZERO
    position_change: Triple = _ZERO
    synchronisation_change: float = 0.0
    of_platform: bool = False


def stated_heads(heads: tuple[HeadSpecification, ...], cameras: int) -> Mapping[str, Floats]:
    """System parameters (cameras, components) of heads as they are stated; nothing without heads."""
    return _of_heads(heads, cameras, 0.0)


def true_heads(heads: tuple[HeadSpecification, ...], cameras: int) -> Mapping[str, Floats]:
    """The same as they truly are."""
    return _of_heads(heads, cameras, 1.0)


def _of_heads(heads: tuple[HeadSpecification, ...], cameras: int, part: float) -> Mapping[str, Floats]:
    if not heads:
        return {}
    position, rotation, offset = np.zeros((cameras, 3)), np.zeros((cameras, 3)), np.zeros((cameras, 1))
    for head in heads:
        position[head.camera] = np.array(head.position) + part * np.array(head.position_change)
        rotation[head.camera] = np.array(head.rotation) + part * np.array(head.rotation_change)
        offset[head.camera] = head.synchronisation + part * head.synchronisation_change
    return {RELATIVE_POSITION: position, RELATIVE_ROTATION: rotation, SYNCHRONISATION_OFFSET: offset}


def rig_of(
    heads: tuple[HeadSpecification, ...],
    cameras: tuple[FrameCamera, ...],
    plan: FlightPlan,
    flown: Trajectory,
) -> Rig | None:
    """All heads take a picture at each exposure of their reference head; None without heads.

    Raises
    ------
    InconsistentBlockError : if a head is its own reference, exists twice, or is flown by itself.
    """
    if not heads:
        return None
    reference: Ints = np.arange(len(cameras), dtype=np.int64)
    for head in heads:
        if reference[head.camera] != head.camera or head.reference == head.camera:
            raise InconsistentBlockError("A head of a rig exists twice, or is its own reference.")
        reference[head.camera] = head.reference
    if np.any(reference[reference] != reference) or np.any(reference[plan.camera] != plan.camera):
        raise InconsistentBlockError(
            "Lines are flown with the reference head of a rig, which has none itself."
        )
    takes_pictures = np.ones(len(cameras), dtype=bool)
    takes_pictures[[head.reference for head in heads if head.of_platform]] = False
    of_rig = [np.flatnonzero((reference == camera) & takes_pictures) for camera in range(len(cameras))]
    # The reference head first.
    ordered = [own[np.argsort(own != camera, kind="stable")] for camera, own in enumerate(of_rig)]
    taken = [ordered[camera] for camera in plan.camera]
    return Rig(
        plan.images,
        np.repeat(np.arange(len(plan.images)), [len(own) for own in taken]).astype(np.int64),
        np.concatenate(taken).astype(np.int64),
        reference,
        np.stack([camera.body_from_camera for camera in cameras]),
        EventMotion(np.einsum("nji,nj->ni", flown.local_from_body, flown.velocity), flown.rate),
    )


def image_names(rig: Rig, cameras: tuple[FrameCamera, ...]) -> tuple[str, ...]:
    """Names of the images: that of the event and that of the head."""
    pairs = zip(rig.event_of_image, rig.camera_of_image, strict=True)
    return tuple(f"{rig.events[event]}_{cameras[camera].name}" for event, camera in pairs)
