"""The identity of a camera: what its calibrations and certificates are filed under."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tasks.settings.base import Settings


def _is_none(value: object) -> bool:
    """Records of cameras without it keep their digest."""
    return value is None


class CameraIdentity(Settings):
    """Serial numbers of the calibrated camera; they decide where a calibration may be applied."""

    manufacturer: str | None = None
    """Manufacturer of the camera, for the certificate."""
    type: str | None = None
    """Type of the camera, for the certificate."""
    body: str | None = None
    """Serial number of the camera body."""
    lens: str | None = None
    """Serial number of the lens or lens cone."""
    imu: str | None = None
    """Serial number of the inertial measurement unit."""
    mount: str | None = None
    """Name of the installation in the aircraft; a new installation has a new boresight."""
    band: str | None = Field(default=None, exclude_if=_is_none)
    """Spectral band of the head, as its certificate names it, e.g. `PAN1` or `MS-Red`; heads of one body may
    differ in nothing else.
    """
    software: str | None = Field(default=None, exclude_if=_is_none)
    """Version of the manufacturer's software that made the images: another one may compose them with another
    size or correct other distortions.
    """
    product: Literal["virtual_image", "camera_head"] = "virtual_image"
    """Type of image: the composed `virtual_image` of a multi-head camera (or the image of a single-head one),
    or one `camera_head`. The calibration of one is never applied to the other.
    """
