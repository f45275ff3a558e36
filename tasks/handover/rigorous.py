"""Rigorous projection of oriented images to the ground, in the Cartesian frame of the adjustment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.refraction import refraction_coefficient, straight_image_points
from adjust.handover.cartesian_map import Pose
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, map_from_local

# The height along a ray is straight but for the curvature of the earth: each round gains five digits.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class OrientedImages:
    """n adjusted images.

    Attributes
    ----------
    names : of the images.
    camera : (n,) index of the camera of each.
    map_frame, frame : of the results and of the adjustment.
    projection_centre : (n, 3) metres, local frame.
    local_from_camera : (n, 3, 3).
    focal_length : (cameras,) metres.
    half_format : (cameras, 2) half the sides of the image, metres.
    pixel_size : (cameras,) metres.
    refracted : whether the rays are bent by the atmosphere, as the adjustment took them.
    """

    names: tuple[str, ...]
    camera: Ints
    map_frame: MapFrame
    frame: AdjustmentFrame
    projection_centre: Floats
    local_from_camera: Floats
    focal_length: Floats
    half_format: Floats
    pixel_size: Floats
    refracted: bool = False

    def only(self, index: int) -> OrientedImages:
        """One of the images."""
        one = slice(index, index + 1)
        return replace(
            self,
            names=self.names[one],
            camera=self.camera[one],
            projection_centre=self.projection_centre[one],
            local_from_camera=self.local_from_camera[one],
        )

    @property
    def map_pose(self) -> Pose:
        """The true orientations in map coordinates: angles count from the grid axes at each camera."""
        centre = map_from_local(self.map_frame, self.frame, self.projection_centre)
        axes = local_from_grid(self.map_frame, self.frame, centre)
        n = len(self.camera)
        return Pose(
            centre,
            np.asarray(np.swapaxes(axes, 1, 2) @ self.local_from_camera),
            self.focal_length[self.camera],
            np.zeros(n),
        )

    def grid_of_image_points(self, side: int) -> Floats:
        """Ideal image points (n, side², 2) spread evenly over each image, metres."""
        steps = np.linspace(-1.0, 1.0, side)
        unit = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        return np.asarray(unit * self.half_format[self.camera][:, None])

    def ground(self, ideal: Floats, height: Floats) -> Floats:
        """Map coordinates (n, k, 3) where ideal image points (n, k, 2) see the ground at heights (n, k)."""
        axes = np.asarray(self.frame.local_from_enu(self.projection_centre))
        start = self._on_map(self.projection_centre)[:, 2:]
        straight = self.straight(ideal, height)
        c = np.broadcast_to(self.focal_length[self.camera][:, None, None], (*ideal.shape[:2], 1))
        ray = np.einsum("nij,nkj->nki", self.local_from_camera, np.concatenate([straight, -c], axis=-1))
        rise = np.einsum("ni,nki->nk", axes[:, :, 2], ray)
        centre, along = self.projection_centre[:, None], (height - start) / rise
        for _ in range(_ROUNDS):
            reached = self._on_map(centre + along[..., None] * ray)
            along = along + (height - reached[..., 2]) / rise
        return self._on_map(centre + along[..., None] * ray)

    def straight(self, ideal: Floats, height: Floats) -> Floats:
        """Ideal image points (n, k, 2) of the straight rays from the ground at heights (n, k)."""
        n, k = ideal.shape[:2]
        flat = self.straight_rays(np.repeat(np.arange(n), k), ideal.reshape(-1, 2), height.ravel())
        return flat.reshape(ideal.shape)

    def straight_rays(self, image: Ints, ideal: Floats, height: Floats) -> Floats:
        """The same of image points (m, 2) in images (m,) from the ground at heights (m,)."""
        if not self.refracted:
            return ideal
        up = np.asarray(self.frame.local_from_enu(self.projection_centre))[:, :, 2]
        above = self._on_map(self.projection_centre)[:, 2]
        interior = np.zeros((len(self.camera), 3))
        interior[:, 0] = self.focal_length[self.camera]
        return straight_image_points(
            ideal,
            interior[image],
            self.local_from_camera[image],
            up[image],
            refraction_coefficient(above[image], height),
        )

    def _on_map(self, x_in_local: Floats) -> Floats:
        flat = map_from_local(self.map_frame, self.frame, x_in_local.reshape(-1, 3))
        return flat.reshape(x_in_local.shape)
