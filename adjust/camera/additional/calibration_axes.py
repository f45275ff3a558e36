"""Calibration axes: the image axes turned by 0, 90, 180 or 270° into those a set is defined in.

BLUH and the sets of composed cameras have x along the flight. turn_deg is the angle, counter-clockwise,
from the image axes to the calibration axes; where calibration x shall point forward it is −κ_mount. The
image system itself stays fixed to the camera (docs/conventions.md).
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, Tiles
from adjust.geometry.rotation import about_z


def calibration_from_image(turn_deg: int) -> Floats:
    """Matrix (2, 2), calibration axes from image axes, exact in its zeros and ones.

    Raises
    ------
    ValueError : if turn_deg is not 0, 90, 180 or 270.
    """
    if turn_deg not in (0, 90, 180, 270):
        raise ValueError(f"turn_deg must be 0, 90, 180 or 270, not {turn_deg}")
    return np.round(about_z(np.deg2rad(-turn_deg)))[:2, :2] + 0.0


def format_in_calibration_axes(
    half_format: tuple[float, float],
    turn_deg: int = 0,
    tiles: Tiles | None = None,
    focal_length: float | None = None,
) -> ImageFormat:
    """The format of an image with half sides (x, y) in image axes, metres; tiles in calibration axes."""
    half_x, half_y = np.abs(calibration_from_image(turn_deg) @ half_format)
    return ImageFormat(float(half_x), float(half_y), tiles, focal_length)
