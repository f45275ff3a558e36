"""Footprints of images: their corners projected onto a horizontal plane, and how many cover a location."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from tasks.document_kit.raster import Raster

# Footprints at a time, so that memory stays small.
_AT_ONCE = 1000


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
    count = np.zeros((raster.rows, raster.columns + 1), dtype=np.int64)
    known = corners[np.isfinite(corners).all(axis=(1, 2))]
    for some in np.array_split(known, -(-len(known) // _AT_ONCE) or 1):
        row, first, last = _columns_inside(some, *raster.centres)
        np.add.at(count, (row, first), 1)
        np.add.at(count, (row, last), -1)
    return np.cumsum(count[:, :-1], axis=1)


def _columns_inside(corners: Floats, x: Floats, y: Floats) -> tuple[Ints, Ints, Ints]:
    """Rows of a grid that convex quadrangles (n, 4, 2) touch, the first column inside, and that behind.

    In a row, every side leaves the places on one side of where it meets the row.
    """
    side = np.roll(corners, -1, axis=1) - corners
    # Either way round: a mirrored order of the corners must not matter.
    area = np.sum(corners[:, :, 0] * np.roll(corners[:, :, 1], -1, axis=1), axis=1)
    area -= np.sum(np.roll(corners[:, :, 0], -1, axis=1) * corners[:, :, 1], axis=1)
    side *= np.where(area < 0.0, -1.0, 1.0)[:, None, None]
    dx, dy = side[:, :, 0, None], side[:, :, 1, None]
    above = y - corners[:, :, 1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        meets = corners[:, :, 0, None] + dx * above / dy
    left = np.where(dy < 0.0, meets, -np.inf).max(axis=1)
    right = np.where(dy > 0.0, meets, np.inf).min(axis=1)
    outside = ((dy == 0.0) & (dx * above < 0.0)).any(axis=1)
    image, row = np.nonzero((left <= right) & ~outside)
    first = np.searchsorted(x, left[image, row], side="left")
    last = np.searchsorted(x, right[image, row], side="right")
    return row, first, last
