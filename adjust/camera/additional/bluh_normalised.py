"""Normalised image coordinates of BLUH: millimetres on an image whose corner lies at r = 162.6."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat

LARGEST_RADIUS = 162.6  # mm, √2 · 115: the corner of a photograph of 23 cm


def normalised_millimetre(image_format: ImageFormat) -> float:
    """One normalised millimetre on the image, metres: half the diagonal of the format / 162.6."""
    return float(np.hypot(image_format.half_x, image_format.half_y)) / LARGEST_RADIUS


class NormalisedPoints:
    """Image points in normalised coordinates, calibration axes.

    Attributes
    ----------
    x, y : (n,) normalised millimetres.
    x_metres, y_metres : (n,) the same on the image.
    metres : one normalised millimetre on the image.
    """

    def __init__(self, xy: Floats, image_format: ImageFormat) -> None:
        self.x_metres, self.y_metres = np.ascontiguousarray(xy.T)
        self.metres = normalised_millimetre(image_format)
        self.x, self.y = self.x_metres / self.metres, self.y_metres / self.metres
