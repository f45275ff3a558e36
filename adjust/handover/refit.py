"""Orientations refitted for a program that treats map coordinates as Cartesian.

Every image has a grid of ideal image points and, for each, where it really sees the ground, in map
coordinates. The six elements of its orientation, and where the program takes our camera one focal length and
one k1 for all images of a camera, are those with the smallest sum of squared differences in the image
(Gauss–Newton; orientations are eliminated first). What is left is the error of the program's model, nothing
random.

The orientations are then no positions of the camera any more: the height moves by up to a metre for each
1,000 m above ground.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.geometry import rotation
from adjust.handover.cartesian_map import CartesianMap, Pose, derivatives, projected

_MOST_ITERATIONS = 12
# A smaller step moves no image point by more than some 1e-7 of a pixel.
_CONVERGED_M = 1e-12
# Images whose derivatives are held in memory together.
_AT_ONCE = 500


@dataclass(frozen=True)
class Freed:
    """What is fitted in addition to the orientations, one value for each camera."""

    focal_length: bool = False
    radial: bool = False

    @property
    def columns(self) -> Ints:
        """Which of (focal length, k1)."""
        return np.flatnonzero([self.focal_length, self.radial])


@dataclass(frozen=True, eq=False)
class Refitted:
    """Fitted orientations.

    Attributes
    ----------
    pose : for the program.
    residual : (n, k, 2) what its model leaves in the image, metres.
    """

    pose: Pose
    residual: Floats

    @property
    def rms(self) -> Floats:
        """(n,) of the lengths in each image, metres."""
        return np.asarray(np.sqrt(np.mean(np.sum(self.residual**2, axis=-1), axis=-1)))

    @property
    def largest(self) -> Floats:
        """(n,) length in each image, metres."""
        return np.asarray(np.sqrt(np.max(np.sum(self.residual**2, axis=-1), axis=-1)))


def refit(
    world: CartesianMap, start: Pose, camera: Ints, ideal: Floats, ground: Floats, freed: Freed
) -> Refitted:
    """Fit orientations, and what is freed of the cameras.

    Parameters
    ----------
    camera : (n,) index of the camera of each image.
    ideal : (n, k, 2) ideal image points, metres from the principal point.
    ground : (n, k, 3) where these really are, map coordinates.
    """
    pose = start
    for _ in range(_MOST_ITERATIONS):
        of_image, of_camera = _step(world, pose, camera, ideal, ground, freed)
        pose = replace(
            pose,
            centre=pose.centre + of_image[:, :3],
            map_from_camera=pose.map_from_camera @ rotation.exp(of_image[:, 3:]),
            focal_length=pose.focal_length + of_camera[camera, 0],
            radial=pose.radial + of_camera[camera, 1],
        )
        in_image = np.abs(of_image) @ _size(pose, ground)
        if max(in_image.max(initial=0.0), np.abs(of_camera[:, 0]).max(initial=0.0)) < _CONVERGED_M:
            break
    return Refitted(pose, ideal - projected(world, pose, ground))


def _size(pose: Pose, ground: Floats) -> Floats:
    """How far a unit of each of the six elements moves image points, about."""
    distance = float(np.median(np.linalg.norm(ground.mean(axis=1) - pose.centre, axis=1)))
    c = float(np.median(pose.focal_length))
    return np.array([c / distance] * 3 + [c] * 3)


def _step(
    world: CartesianMap, pose: Pose, camera: Ints, ideal: Floats, ground: Floats, freed: Freed
) -> tuple[Floats, Floats]:
    """Increments of orientations (n, 6) and of focal lengths and k1 of the cameras (cameras, 2)."""
    n, cameras = len(camera), int(camera.max()) + 1
    columns = freed.columns
    d = len(columns)
    scale = np.array([1.0, 1e3])[columns]  # metres compared with a number of 1e-4
    own, eliminated = np.zeros((n, 6)), np.zeros((n, 6, d))
    normal, right = np.zeros((cameras, d, d)), np.zeros((cameras, d))
    for first in range(0, n, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        of_part = _only(pose, part)
        misfit = (ideal[part] - projected(world, of_part, ground[part])).reshape(len(of_part.centre), -1)
        by_image, by_camera = derivatives(world, of_part, ground[part])
        a = by_image.reshape(*misfit.shape, 6)
        b = by_camera.reshape(*misfit.shape, 2)[:, :, columns] / scale
        q, r = np.linalg.qr(a)
        turned = np.swapaxes(q, 1, 2)
        own[part] = np.linalg.solve(r, (turned @ misfit[:, :, None]))[:, :, 0]
        if not d:
            continue
        eliminated[part] = np.linalg.solve(r, turned @ b)
        left = b - q @ (turned @ b)
        rest = misfit - (q @ (turned @ misfit[:, :, None]))[:, :, 0]
        np.add.at(normal, camera[part], np.swapaxes(left, 1, 2) @ left)
        np.add.at(right, camera[part], np.einsum("nkd,nk->nd", left, rest))
    of_camera = np.zeros((cameras, 2))
    if d:
        solved = np.stack([np.linalg.lstsq(one, two)[0] for one, two in zip(normal, right, strict=True)])
        of_camera[:, columns] = solved / scale
        own = own - np.einsum("nid,nd->ni", eliminated, solved[camera])
    return own, of_camera


def _only(pose: Pose, part: slice) -> Pose:
    return Pose(pose.centre[part], pose.map_from_camera[part], pose.focal_length[part], pose.radial[part])
