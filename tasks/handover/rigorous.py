"""Where oriented images really see the ground: through the Cartesian frame of the adjustment, into the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.handover.cartesian_map import Pose
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, local_from_map, map_from_local

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
        """Where ideal image points (n, k, 2) see the ground at map heights (n, k): (n, k, 3) map coordinates."""
        c = np.broadcast_to(self.focal_length[self.camera][:, None, None], (*ideal.shape[:2], 1))
        ray = np.einsum("nij,nkj->nki", self.local_from_camera, np.concatenate([ideal, -c], axis=-1))
        centre = self.projection_centre[:, None]
        axes = np.asarray(self.frame.local_from_enu(self.projection_centre))
        rise = np.einsum("ni,nki->nk", axes[:, :, 2], ray)
        start = map_from_local(self.map_frame, self.frame, self.projection_centre)[:, 2]
        along = (height - start[:, None]) / rise
        for _ in range(_ROUNDS):
            reached = self._on_map(centre + along[..., None] * ray)
            along = along + (height - reached[..., 2]) / rise
        return self._on_map(centre + along[..., None] * ray)

    def in_local(self, x_in_map: Floats) -> Floats:
        """Local coordinates (…, 3) of map coordinates."""
        return local_from_map(self.map_frame, self.frame, x_in_map.reshape(-1, 3)).reshape(x_in_map.shape)

    def _on_map(self, x_in_local: Floats) -> Floats:
        flat = map_from_local(self.map_frame, self.frame, x_in_local.reshape(-1, 3))
        return flat.reshape(x_in_local.shape)
