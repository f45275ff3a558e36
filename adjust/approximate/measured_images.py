"""Image points of images without orientation, in the form that relative orientation and resection need.

Those solvers (of PoseLib: five points, or three, inside RANSAC) count y down and look along +z: their camera
frame is diag(1, −1, −1) times ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from adjust.arrays import Bools, Floats, Ints, order_of_numbers
from adjust.camera.interior import FrameCamera
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION, State

#: Their camera frame from ours, and the other way round.
SOLVER_FROM_CAMERA = np.diag([1.0, -1.0, -1.0])
#: Limits of a residual, tried one after the other, px: for a calibrated lens, an uncalibrated, a bad one.
LIMITS_PX = (3.0, 10.0, 30.0)
#: The part of the points that must keep a limit before a wider one is tried.
ENOUGH = 0.6


@dataclass(frozen=True, eq=False)
class MeasuredImages:
    """Images with their image points, cameras with approximate interior orientation.

    Attributes
    ----------
    rays : the image points of the n images and m object points.
    cameras : the cameras.
    points : m.
    """

    rays: ImagePoints
    cameras: tuple[FrameCamera, ...]
    points: int

    @property
    def images(self) -> int:
        """Number n of images."""
        return len(self.rays.camera_of_image)

    @cached_property
    def interior(self) -> Floats:
        """(cameras, 3) c, x0, y0 in metres."""
        return np.array([[camera.focal_length, *camera.principal_point] for camera in self.cameras])

    @cached_property
    def pixel_size(self) -> Floats:
        """(n,) metres."""
        return np.array([camera.pixel_size for camera in self.cameras])[self.rays.camera_of_image]

    @cached_property
    def rows_of_image(self) -> tuple[Ints, ...]:
        """Rows of the image points of every image, ascending by object point."""
        order = order_of_numbers(self.rays.image)
        starts = np.searchsorted(self.rays.image[order], np.arange(1, self.images))
        return tuple(np.split(order, starts))

    @cached_property
    def pixel(self) -> Floats:
        """(rays, 2) image points from the principal point, y down, pixels."""
        principal = self.interior[self.rays.camera_of_image[self.rays.image], 1:]
        size = self.pixel_size[self.rays.image][:, None]
        return np.asarray((self.rays.xy - principal) / size * np.array([1.0, -1.0]))

    def focal_px(self, image: int) -> float:
        """Principal distance of an image in pixels."""
        return float(self.interior[self.rays.camera_of_image[image], 0] / self.pixel_size[image])

    def camera(self, image: int) -> dict[str, Any]:
        """The camera of an image in the conventions of the solvers."""
        focal = self.focal_px(image)
        return {"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [focal, 0.0, 0.0]}

    def state(self, centre: Floats, local_from_camera: Floats, object_point: Floats) -> State:
        """Values with the approximate interior orientation."""
        return State(centre, local_from_camera, object_point, {INTERIOR_ORIENTATION: self.interior})

    def residual_px(self, state: State) -> Floats:
        """(rays,) length of the residuals at a state, pixels; infinite behind the camera or if not known."""
        missed = np.linalg.norm(self.rays.misclosure(state), axis=1) / self.pixel_size[self.rays.image]
        return np.where(np.isfinite(missed), missed, np.inf)

    def only(self, kept: Bools) -> MeasuredImages:
        """The image points of some images (n,); the others keep their numbers and have none."""
        rays = self.rays.only(np.flatnonzero(kept[self.rays.image]).astype(np.int64))
        return MeasuredImages(rays, self.cameras, self.points)


def orientation(rotation: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Projection centre (3,) and rotation (3, 3) local from camera of x = R X + t in the solvers' axes."""
    return -rotation.T @ shift, rotation.T @ SOLVER_FROM_CAMERA
