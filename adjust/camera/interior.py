"""Interior orientation of a frame camera, its pixel grid and its mounting in the aircraft.

The image system is fixed to the camera: origin at the format centre, x along increasing columns, y
against increasing rows. The camera frame has the same x and y, and z away from the terrain, so the
scene lies at z = −c. The mounting enters only the rotation camera → body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.geometry.rotation import about_z

PixelOrigin = Literal["corner", "centre"]
MOUNTINGS_DEG = (0, 90, 180, 270)


@dataclass(frozen=True)
class FrameCamera:
    """A frame camera as its certificate or file describes it; lengths in metres.

    Attributes
    ----------
    name : the camera's name in the project.
    columns, rows : size of the image in pixels.
    pixel_size : side of a (square) pixel.
    focal_length : principal distance c.
    principal_point : (x0, y0) in the image system, from the format centre.
    pixel_origin : which point of the top-left pixel has the pixel coordinates (0, 0).
    mount_deg : κ_mount, 0, 90, 180 or 270; 0 means that image x points forward.

    Raises
    ------
    InconsistentBlockError : of values that no camera has.
    """

    name: str
    columns: int
    rows: int
    pixel_size: float
    focal_length: float
    principal_point: tuple[float, float]
    pixel_origin: PixelOrigin
    mount_deg: int

    def __post_init__(self) -> None:
        for name in ("columns", "rows", "pixel_size", "focal_length"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InconsistentBlockError(f"The {name} of camera {self.name} is {getattr(self, name)}.")
        point = self.principal_point
        if np.shape(point) != (2,) or not np.isfinite(point).all():
            raise InconsistentBlockError(
                f"The principal_point of camera {self.name} is {point}, not two lengths x0, y0."
            )
        choices: dict[str, tuple[object, ...]] = {
            "pixel_origin": get_args(PixelOrigin),
            "mount_deg": MOUNTINGS_DEG,
        }
        for name, possible in choices.items():
            if getattr(self, name) not in possible:
                raise InconsistentBlockError(
                    f"The {name} of camera {self.name} is {getattr(self, name)!r}, not one of "
                    f"{', '.join(map(repr, possible))}."
                )

    @property
    def half_format(self) -> tuple[float, float]:
        """Half the side of the image along x and y, metres."""
        return 0.5 * self.columns * self.pixel_size, 0.5 * self.rows * self.pixel_size

    def _centre_pixel(self) -> tuple[float, float]:
        """Pixel coordinates (column, row) of the format centre."""
        shift = 0.0 if self.pixel_origin == "corner" else 0.5
        return 0.5 * self.columns - shift, 0.5 * self.rows - shift

    def image_from_pixel(self, pixel: Floats) -> Floats:
        """Image coordinates (n, 2) in metres of pixel coordinates (n, 2) = column, row."""
        column, row = self._centre_pixel()
        pixel = np.asarray(pixel, dtype=np.float64)
        return np.stack(
            [(pixel[..., 0] - column) * self.pixel_size, (row - pixel[..., 1]) * self.pixel_size], -1
        )

    def pixel_from_image(self, xy: Floats) -> Floats:
        """Pixel coordinates (n, 2) = column, row of image coordinates (n, 2) in metres."""
        column, row = self._centre_pixel()
        xy = np.asarray(xy, dtype=np.float64)
        return np.stack([xy[..., 0] / self.pixel_size + column, row - xy[..., 1] / self.pixel_size], -1)

    @cached_property
    def body_from_camera(self) -> Floats:
        """Nominal mounting T (3, 3), body (forward, right, down) from camera."""
        return nominal_mounting(self.mount_deg)


def nominal_mounting(mount_deg: int) -> Floats:
    """Nominal mounting T (3, 3), body (forward, right, down) from camera: diag(1, −1, −1) R_z(κ_mount).

    Exact in its zeros and ones for the four possible values.

    Raises
    ------
    ValueError : if mount_deg is not 0, 90, 180 or 270.
    """
    if mount_deg not in MOUNTINGS_DEG:
        raise ValueError(f"mount_deg must be 0, 90, 180 or 270, not {mount_deg}")
    return np.diag([1.0, -1.0, -1.0]) @ np.round(about_z(np.deg2rad(mount_deg)))
