"""UNDISTORTED.txt: what undistorted images contain and what they do not, in plain sentences."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from adjust.resampling.resampled import Resampling
from tasks.handover.undistorted.camera_map import CameraMap

STATEMENT = "UNDISTORTED.txt"
_WIDTH = 78
_WORDS: dict[Resampling, str] = {
    "cubic": "cubic convolution (Keys, a = -1/2, 4 x 4 pixels)",
    "lanczos": "Lanczos' window (6 x 6 pixels)",
}


@dataclass(frozen=True)
class UndistortedImage:
    """An image that was written.

    Attributes
    ----------
    file, camera : their names.
    outside : part of its pixels that lies outside of what was taken, 0 to 1.
    left_out : what of the taken image applies to its pixels only and was not copied.
    """

    file: str
    camera: str
    outside: float
    left_out: tuple[str, ...]


def undistorted_statement(
    maps: Sequence[CameraMap], images: Sequence[UndistortedImage], resampling: Resampling
) -> str:
    """The text."""
    parts = [
        "The images are as cameras without distortion would have taken them, with the focal lengths and "
        "principal points of cameras.csv (mm from the centre of the format, x right, y up). Exterior "
        "orientations are those of the results, unchanged.",
        *(_about_camera(one) for one in maps),
        "Contained: additional parameters and mean residuals. NOT contained: refraction and the "
        "curvature of the earth, which depend on the ground. The program must not apply any other "
        "distortion of the camera.",
        f"Pixels are resampled by {_WORDS[resampling]}; at borders and next to pixels without data, "
        "bilinearly between the valid ones. Pixels outside the original image have the no-data value or "
        "0.",
    ]
    listed = [_about_image(one) for one in images]
    return "\n\n".join([*(textwrap.fill(part, _WIDTH) for part in parts), "\n".join(listed)]) + "\n"


def _about_camera(one: CameraMap) -> str:
    camera = one.camera
    return (
        f"Camera {camera.frame.name}: additional parameters change image points by up to "
        f"{1e6 * camera.largest_distortion:.1f} µm, mean residuals by up to "
        f"{1e6 * camera.largest_mean_residual:.1f} µm, both together by up to {one.largest_shift_px:.2f} "
        "pixels. Source positions are interpolated; the largest error found is "
        f"{one.pixels.error_px:.4f} pixels."
    )


def _about_image(one: UndistortedImage) -> str:
    text = (
        f"{one.file}: camera {one.camera}; {100.0 * one.outside:.2f} % of its pixels are outside the "
        "original image"
    )
    return text + (f"; without the {' and '.join(one.left_out)} of the image." if one.left_out else ".")
