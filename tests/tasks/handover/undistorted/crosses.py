"""A camera with all that can distort an image, and an image of crosses that it takes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_correction import CorrectionField
from tasks.block.self_calibration import additional_parameters_of, image_format_of
from tasks.handover.distortion_grid import ideal_points
from tasks.handover.results import CalibratedCamera

PIXEL = 4e-6
# At least 15 pixels from the nearest crosses: none is cut, and each has to be on its side of the jump.
SEAMS_MM = ((-1.1, 1.3), (-1.26, 1.5))
# 15 µm of lens distortion in the corner; CCD images that are shifted by 1 to 3 µm, with scales of their own.
KNOWN = {
    "brown:K1": 5e2, "brown:P1": 1.35e-1, "brown:P2": -9e-2,
    "bluh:51": 1.5e-3, "bluh:54": -2.2e-3, "bluh:57": 3.1e-3, "bluh:59": -1.7e-3, "bluh:63": 2.4e-3,
    "bluh:45": 3e-4, "bluh:48": -2e-4,
}  # fmt: skip
#: Pixels between crosses, half a bar of them, and σ of its profile.
APART, HALF_BAR, SIGMA = 50, 12, 1.3
BRIGHT = 40_000.0


def distorting_camera(columns: int = 1000, rows: int = 1200, *, distorted: bool = True) -> CalibratedCamera:
    """A camera with lens distortion, tile steps and mean residuals, or without all of them."""
    frame = FrameCamera("UC", columns, rows, PIXEL, 0.08, (31e-6, -47e-6), "corner", 0)
    (seams_x, seams_y), known = SEAMS_MM, KNOWN if distorted else {}
    tiles = {"seams_x_mm": seams_x, "seams_y_mm": seams_y, "blend_mm": 0.0, "perspective": "master4"}
    row: dict[object, object] = {
        "columns": columns, "rows": rows, "pixel_um": PIXEL * 1e6, "focal_length_mm": 80.0,
        "tiles": json.dumps(tiles),
    }  # fmt: skip
    additional = additional_parameters_of("UC", "+".join(known) or "none", image_format_of(row, 0), 0)
    camera = CalibratedCamera(frame, additional, np.array([known[name] for name in additional.names]))
    if not distorted:
        return camera
    along_x, along_y = (tuple(1e-3 * one for one in axis) for axis in SEAMS_MM)
    cells = FormatCells.of(frame.half_format, 9, Seams(along_x, along_y))
    field = CorrectionField(cells, np.random.default_rng(2).normal(0.0, 1.5e-6, (cells.count, 2)))
    return replace(camera, grid=field)


def centres(camera: CalibratedCamera) -> Floats:
    """(n, 2) columns and rows of the crosses in an image without distortion; not of whole pixels."""
    frame = camera.frame
    along = [np.arange(APART, side - APART, APART) + 0.0 for side in (frame.columns, frame.rows)]
    place = np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)
    return np.asarray(place + np.random.default_rng(4).uniform(-0.5, 0.5, place.shape))


def taken_image(camera: CalibratedCamera) -> NDArray[np.uint16]:
    """(1, rows, columns): what the camera sees at the ideal point of each of its pixels."""
    frame = replace(camera.frame, pixel_origin="centre")
    image = np.empty((1, frame.rows, frame.columns), np.uint16)
    for first in range(0, frame.rows, 200):
        row, column = np.mgrid[first : min(first + 200, frame.rows), : frame.columns]
        place = np.stack([column.ravel(), row.ravel()], axis=-1).astype(np.float64)
        ideal = frame.pixel_from_image(ideal_points(camera, frame.image_from_pixel(place)))
        image[0, first : first + 200] = np.rint(_brightness(camera, ideal)).reshape(row.shape)
    return image


def _brightness(camera: CalibratedCamera, ideal: Floats) -> Floats:
    """(n,) at ideal positions (n, 2), of the nearest cross."""
    along = [(side - 2 * APART - 1) // APART for side in (camera.frame.columns, camera.frame.rows)]
    number = np.clip(np.rint(ideal / APART).astype(int) - 1, 0, along)
    away = ideal - centres(camera)[number[:, 1] * (along[0] + 1) + number[:, 0]]
    profile = np.exp(-0.5 * (away / SIGMA) ** 2)
    # The ends of bars are soft, too.
    length = 1.0 / (1.0 + np.exp((np.abs(away) - HALF_BAR) / 0.5))
    return np.asarray(BRIGHT * np.maximum(profile[:, 0] * length[:, 1], profile[:, 1] * length[:, 0]))


def measured_centres(image: NDArray[np.uint16], expected: Floats) -> Floats:
    """(n, 2) columns and rows of crosses near expected places, by the centroid across each of their bars."""
    found = np.empty_like(expected)
    across, along = np.arange(-6, 7), np.array([*range(-10, -4), *range(5, 11)])
    for k, (column, row) in enumerate(np.rint(expected).astype(int)):
        upright = image[np.ix_(row + along, column + across)].astype(float).sum(axis=0)
        level = image[np.ix_(row + across, column + along)].astype(float).sum(axis=1)
        found[k] = column + upright @ across / upright.sum(), row + level @ across / level.sum()
    return found
