"""Footprints of images: their corners projected onto a horizontal plane, and how many cover a location."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from tasks.document_kit.raster import Raster


def footprints(images: pd.DataFrame, cameras: Mapping[str, FrameCamera]) -> Floats:
    """Corners (n, 4, 2) of the images on the terrain, map coordinates, m.

    The rays of the four format corners meet the plane at the image's mean terrain height; map coordinates
    count as Cartesian within one image (a drawing: refraction, curvature of the earth and the scale of the
    projection would move a corner by less than a line's width). A corner whose ray does not go down is NaN.

    Parameters
    ----------
    images : image, camera, x_m, y_m, z_m, omega_deg, phi_deg, kappa_deg, ground_m.
    """
    angles = np.deg2rad(images[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(np.float64))
    grid_from_camera = rotation.from_omega_phi_kappa(angles)
    corners = np.array([_corners(cameras[name]) for name in images["camera"]]).reshape(-1, 4, 3)
    direction = np.einsum("nij,nkj->nki", grid_from_camera, corners)
    centre = images[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    drop = centre[:, 2] - images["ground_m"].to_numpy(np.float64)
    downwards = np.where(direction[:, :, 2] < 0.0, direction[:, :, 2], np.nan)
    factor = -drop[:, None] / downwards
    return np.asarray(centre[:, None, :2] + factor[:, :, None] * direction[:, :, :2])


def _corners(camera: FrameCamera) -> Floats:
    """Rays (4, 3) of the format corners in the camera frame, in their order around the image."""
    half_x, half_y = camera.half_format
    x0, y0 = camera.principal_point
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.array([[sx * half_x - x0, sy * half_y - y0, -camera.focal_length] for sx, sy in signs])


def overlap(corners: Floats, raster: Raster) -> Ints:
    """Number of footprints (rows, columns) that contain the middle of each cell; corners (n, 4, 2)."""
    count = np.zeros((raster.rows, raster.columns), dtype=np.int64)
    x, y = raster.centres
    for corner in corners[np.isfinite(corners).all(axis=(1, 2))]:
        columns = slice(*np.searchsorted(x, [corner[:, 0].min(), corner[:, 0].max()]))
        rows = slice(*np.searchsorted(y, [corner[:, 1].min(), corner[:, 1].max()]))
        count[rows, columns] += _inside(corner, x[columns], y[rows])
    return count


def _inside(corner: Floats, x: Floats, y: Floats) -> Ints:
    """1 where a grid of places (rows, columns) lies inside a convex quadrangle (4, 2), else 0."""
    side = np.roll(corner, -1, axis=0) - corner
    cross = [
        dx * (y[:, None] - cy) - dy * (x[None, :] - cx)
        for (dx, dy), (cx, cy) in zip(side, corner, strict=True)
    ]
    stacked = np.array(cross)
    # Either way round: a mirrored order of the corners must not matter.
    return np.asarray((stacked >= 0).all(axis=0) | (stacked <= 0).all(axis=0)).astype(np.int64)
