"""Where in a taken image the pixels of an undistorted one are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.resampling.pixel_map import PixelMap, pixel_map
from tasks.handover.distortion_grid import ideal_points, measured_points
from tasks.handover.results import CalibratedCamera

# A measured point whose own ideal point is further than this from the one that was requested belongs to
# another place: far outside, a distortion folds back. At a seam it is as far as the jump there.
_FOLDED_PX = 20.0


@dataclass(frozen=True, eq=False)
class CameraMap:
    """The ideal camera has the format, pixels, focal length and principal point of the camera itself.

    Attributes
    ----------
    camera : as calibrated.
    pixels : position in a taken image of every pixel of an undistorted one.
    largest_shift_px : between the two.
    """

    camera: CalibratedCamera
    pixels: PixelMap
    largest_shift_px: float


def camera_map(camera: CalibratedCamera) -> CameraMap:
    """The map of additional parameters and mean residuals."""
    # Pixels count from the centre of the first one here, whatever the delivered coordinates do.
    frame = replace(camera.frame, pixel_origin="centre")
    size = (frame.columns, frame.rows)

    def source_of(place: Floats) -> Floats:
        ideal = frame.image_from_pixel(place)
        measured = measured_points(camera, ideal)
        away = np.abs(ideal_points(camera, measured) - ideal).max(axis=1)
        folded = ~(away < _FOLDED_PX * frame.pixel_size)
        return np.where(folded[:, None], np.nan, frame.pixel_from_image(measured))

    found = pixel_map(source_of, size, size)
    return CameraMap(camera, found, _largest_shift(found))


def _largest_shift(pixels: PixelMap) -> float:
    """Largest distance, pixels, at the nodes that lie in the image."""
    steps = [64.0 * np.arange(side) for side in pixels.nodes.shape[1::-1]]
    place = np.stack(np.meshgrid(*steps), axis=-1)
    inside = (place < [pixels.columns, pixels.rows]).all(axis=-1)
    return float(np.nanmax(np.linalg.norm((pixels.nodes - place)[inside], axis=-1), initial=0.0))
