"""The formats that can be read: a new one is a new file and one line here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from tasks.formats.ign_camera import read_ign_camera
from tasks.formats.ign_text import read_ign_app, read_ign_mes, read_ign_opk
from tasks.formats.native_csv import (
    read_csv_control,
    read_csv_distances,
    read_csv_exposures,
    read_csv_image_points,
)
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
)

ImagePointReader: TypeAlias = Callable[[Path], ImagePointRecords]
ExposureReader: TypeAlias = Callable[[Path, AngleOrder], ExposureRecords]
ControlReader: TypeAlias = Callable[[Path], ControlRecords]
DistanceReader: TypeAlias = Callable[[Path], DistanceRecords]
CameraReader: TypeAlias = Callable[[Path], CameraRecord]

IMAGE_POINT_FORMATS: dict[str, ImagePointReader] = {"csv": read_csv_image_points, "ign-mes": read_ign_mes}
EXPOSURE_FORMATS: dict[str, ExposureReader] = {"csv": read_csv_exposures, "ign-opk": read_ign_opk}
CONTROL_FORMATS: dict[str, ControlReader] = {"csv": read_csv_control, "ign-app": read_ign_app}
DISTANCE_FORMATS: dict[str, DistanceReader] = {"csv": read_csv_distances}
CAMERA_FORMATS: dict[str, CameraReader] = {"ign-xml": read_ign_camera}


def image_point_formats() -> tuple[str, ...]:
    """Names of the formats of image points."""
    return tuple(IMAGE_POINT_FORMATS)


def exposure_formats() -> tuple[str, ...]:
    """Names of the formats of exposures."""
    return tuple(EXPOSURE_FORMATS)


def control_formats() -> tuple[str, ...]:
    """Names of the formats of control points."""
    return tuple(CONTROL_FORMATS)


def distance_formats() -> tuple[str, ...]:
    """Names of the formats of distances."""
    return tuple(DISTANCE_FORMATS)


def camera_formats() -> tuple[str, ...]:
    """Names of the formats of camera files."""
    return tuple(CAMERA_FORMATS)
