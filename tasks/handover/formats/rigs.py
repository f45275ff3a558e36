"""Rigs of a block for formats that have them: how their heads sit, where they are, images of the events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from tasks.handover.delivery import Delivery
from tasks.handover.formats.camera_axes import camera_from_world


@dataclass(frozen=True, eq=False)
class WrittenRigs:
    """Heads that sit beside their reference heads alike in all events; axes x right, y down, z forward.

    Attributes
    ----------
    reference : (c,) reference head of each camera; a camera alone is its own.
    camera : (n,) of the images.
    turn, shift : (c, 3, 3) and (c, 3): X_head = R X_reference + t.
    rig_turn, rig_shift : (n, 3, 3) and (n, 3) of the reference head at each image: X_reference = R X + t.
    events : the images of every event.
    """

    reference: Ints
    camera: Ints
    turn: Floats
    shift: Floats
    rig_turn: Floats
    rig_shift: Floats
    events: tuple[Ints, ...]

    @property
    def back(self) -> tuple[Floats, Floats]:
        """Rotations (c, 3, 3) and places (c, 3) of the heads in the axes of their reference heads."""
        turn = np.swapaxes(self.turn, 1, 2)
        return turn, -np.einsum("cij,cj->ci", turn, self.shift)

    def with_reference(self) -> list[tuple[int, Ints]]:
        """Every event with the image of its reference head, first; without one, each image is alone."""
        found: list[tuple[int, Ints]] = []
        for images in self.events:
            of_reference = images[self.reference[self.camera[images]] == self.camera[images]]
            if len(of_reference):
                first = int(of_reference[0])
                found.append((first, np.concatenate([[first], images[images != first]])))
            else:
                found += [(int(image), np.array([image])) for image in images]
        return found


def written_rigs(delivery: Delivery) -> WrittenRigs | None:
    """The rigs of a block; None without any, or if no format of rigs can have them (`RigHeads`)."""
    heads, camera = delivery.results.heads, delivery.results.images.camera
    if heads is None:
        return None
    rotation, translation = camera_from_world(delivery)
    relative = heads.against_reference(camera, rotation, translation)
    if relative is None:
        return None
    turn, shift = relative
    back = np.swapaxes(turn, 1, 2)[camera]
    order = np.argsort(heads.event, kind="stable")
    ends = np.flatnonzero(np.diff(heads.event[order])) + 1
    return WrittenRigs(
        heads.reference,
        camera,
        turn,
        shift,
        back @ rotation,
        np.einsum("nij,nj->ni", back, translation - shift[camera]),
        tuple(np.split(order, ends)),
    )
