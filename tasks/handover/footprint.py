"""Footprints of oriented images on the curved earth."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.handover.results import Results

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
# Least part of a ray that goes down; a flatter one meets the ground towards the horizon.
_STEEP = 0.1


def footprints(results: Results) -> tuple[Floats, Bools]:
    """Closed rings (n, 5, 3) of the corners in the map, and whether all of an image's rays meet it."""
    images = results.images
    corners = np.stack(
        [camera.ideal(_CORNERS * np.array(camera.frame.half_format)) for camera in results.cameras]
    )[images.camera]
    height = np.repeat(results.ground[:, 1:2], len(_CORNERS), axis=1)
    up = np.asarray(images.frame.local_from_enu(images.projection_centre))[:, :, 2]
    c = np.broadcast_to(images.focal_length[images.camera][:, None, None], (*corners.shape[:2], 1))
    rays = np.einsum("nij,nkj->nki", images.local_from_camera, np.concatenate([corners, -c], axis=-1))
    steep = np.einsum("ni,nki->nk", up, rays) < -_STEEP * np.linalg.norm(rays, axis=-1)
    return images.ground(corners, height), steep.all(axis=1)
