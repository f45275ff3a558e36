"""Cameras between the project file, their table and the mathematics."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
import pandas as pd

from adjust.camera.interior import FrameCamera, PixelOrigin
from adjust.geometry import rotation
from tasks.deliveries.film_reports import film_camera
from tasks.deliveries.head_certificates import USES, certificate_of, stated_covariance
from tasks.errors import InputError, Location
from tasks.formats.records import CameraRecord, PixelCamera
from tasks.formats.register import read_cameras
from tasks.nearest_name import did_you_mean
from tasks.settings.cameras import REGISTRY, RIG_REGISTRY, CameraInput
from tasks.tables.parquet import write_table
from tasks.tables.schemas.deliveries import CAMERAS

_MM = 1e-3
_BODY = ("roll", "pitch", "yaw")
_UM = 1e-6
# From the smallest detectors to coarsely scanned film, and the longest side of an aerial film.
_PIXELS_UM = (0.3, 300.0)
_LONGEST_MM = 600.0
# Focal lengths as parts of the longer side of the image: a fisheye, and a telescope.
_FOCAL_LENGTHS = (0.1, 50.0)


def write_cameras(path: Path, cameras: Mapping[str, CameraInput]) -> None:
    """Write the table of cameras, reading the camera files the project names.

    Raises
    ------
    InputError
        If a camera file cannot be read.
    """
    rows = [_row(name, cameras) for name in cameras]
    write_table(
        path, CAMERAS, {column.name: [row[column.name] for row in rows] for column in CAMERAS.columns}
    )


def camera_table(cameras: Mapping[str, CameraInput]) -> pd.DataFrame:
    """The rows that ``write_cameras`` writes."""
    return pd.DataFrame([_row(name, cameras) for name in cameras])


def camera_record(camera: CameraInput) -> CameraRecord:
    """A camera of the project file, read from its file if it has one.

    Raises
    ------
    InputError
        If the camera file cannot be read.
    """
    if camera.head_certificate is not None:
        return certificate_of(camera, camera.head_certificate).camera
    if camera.calibration_report is not None:
        film = film_camera(camera)
        _refuse_impossible(film, None)
        return film
    if camera.file is not None and camera.format is not None:
        elsewhere = () if camera.principal_point_mm is None else ("x0_mm", "y0_mm")
        layout = replace(camera.table.layout, elsewhere=elsewhere)
        read = _of_file(camera, camera.file, read_cameras(camera.format, camera.file, layout))
        _refuse_impossible(read, camera.file)
        return read
    # The settings have made sure that all values are there when there is no file.
    given = CameraRecord(
        columns=cast(int, camera.columns),
        rows=cast(int, camera.rows),
        pixel_um=cast(float, camera.pixel_um),
        focal_length_mm=cast(float, camera.focal_length_mm),
        principal_point_mm=cast(tuple[float, float], camera.principal_point_mm),
    )
    _refuse_impossible(given, None)
    return given


def _of_file(
    camera: CameraInput, file: Path, found: Mapping[str, CameraRecord | PixelCamera]
) -> CameraRecord:
    """The right camera among those of its file, with the declared size of its pixels."""
    name = camera.name_in_file
    if name is None and len(found) == 1:
        read = next(iter(found.values()))
    elif name is not None and name in found:
        read = found[name]
    else:
        known = did_you_mean(name or "", found)
        raise Location(file).error(
            f"The camera '{name}' is not in the file." if name else f"The file has {len(found)} cameras.",
            f"Declare name_in_file. {known}",
        )
    if isinstance(read, PixelCamera):
        if camera.pixel_um is None:
            raise Location(file).error(
                "The file gives the camera in pixels, but not the pixel size.",
                "Declare pixel_um for this camera, next to its file.",
            )
        return read.with_pixel(camera.pixel_um)
    if camera.pixel_um is not None:
        raise Location(file).error(
            f"The file gives pixels of {read.pixel_um:g} µm, but pixel_um is also declared.",
            "Leave pixel_um out, so that the two cannot differ.",
        )
    return _with_principal_point(camera, file, read)


def _with_principal_point(camera: CameraInput, file: Path, read: CameraRecord) -> CameraRecord:
    """The camera of a table with the principal point from the project file, its only source."""
    declared, known = camera.principal_point_mm, math.isfinite(sum(read.principal_point_mm))
    if declared is None and known:
        return read
    if declared is None or known:
        raise Location(file).error(
            "The table and the project file have a principal point."
            if known
            else "The table does not have the principal point of this camera.",
            "Leave principal_point_mm out." if known else "Declare principal_point_mm of this camera.",
        )
    return replace(read, principal_point_mm=declared)


def _refuse_impossible(camera: CameraRecord, file: Path | None) -> None:
    """Refuse lengths that no camera has: a unit was mistaken for another."""
    sides_mm = [number * camera.pixel_um * 1e-3 for number in (camera.columns, camera.rows)]
    longest_mm, focal_mm = max(sides_mm), camera.focal_length_mm
    size = " × ".join(f"{side:.6g}" for side in sides_mm)
    low, high = _PIXELS_UM
    if not (low <= camera.pixel_um <= high and longest_mm <= _LONGEST_MM):
        raise Location(file).error(
            f"Pixels of {camera.pixel_um:g} µm make an image of {longest_mm:.6g} mm, with a focal length of "
            f"{focal_mm:.6g} mm. Pixels are {low:g} to {high:g} µm wide, and images up to "
            f"{_LONGEST_MM:g} mm.",
            "Correct the size of the pixel or its unit: pixel_um is in µm, <pixel_size> of a camera file in "
            "m.",
        )
    if not _FOCAL_LENGTHS[0] <= focal_mm / longest_mm <= _FOCAL_LENGTHS[1]:
        raise Location(file).error(
            f"A focal length of {focal_mm:.6g} mm with an image of {longest_mm:.6g} mm is not possible.",
            "Correct the focal length or its unit: focal_length_mm is in mm.",
        )
    x, y = camera.principal_point_mm
    if any(abs(value) > side for value, side in zip((x, y), sides_mm, strict=True)):
        raise Location(file).error(
            f"The principal point ({x:.6g}, {y:.6g}) mm lies outside the image of {size} mm.",
            "Give it from the centre of the image, in mm.",
        )


def _row(name: str, cameras: Mapping[str, CameraInput]) -> dict[str, str | int | float | None]:
    camera = cameras[name]
    try:
        record, mounting = camera_record(camera), _mounting(name, cameras)
    except InputError as error:
        raise replace(error, entity=error.entity or f"cameras.{name}") from error
    row: dict[str, str | int | float | None] = {
        "camera": name,
        "columns": record.columns,
        "rows": record.rows,
        "pixel_um": record.pixel_um,
        "focal_length_mm": record.focal_length_mm,
        "principal_point_x_mm": record.principal_point_mm[0],
        "principal_point_y_mm": record.principal_point_mm[1],
        "pixel_origin": camera.pixel_origin,
        "mount_deg": camera.mount_deg,
        "calibration_axes_deg": camera.calibration_axes_deg,
        "tiles": None if camera.tiles is None else camera.tiles.model_dump_json(),
        "additional_parameters": json.dumps(
            {**record.additional_parameters, **camera.additional_parameters}, sort_keys=True
        ),
    }
    known = stated_covariance(camera)
    row |= {
        "calibration_use": None if known is None else camera.calibration_use,
        "calibration_covariance": None
        if known is None
        else json.dumps({key: value for key, value in asdict(known).items() if value or key != "cameras"}),
    }
    row |= {f"lever_arm_{axis}_m": value for axis, value in zip("xyz", mounting.lever_arm_m, strict=True)}
    reduced_by = mounting.lever_arm_m if camera.reduced_by_m is None else camera.reduced_by_m
    row |= {f"reduced_by_{axis}_m": value for axis, value in zip("xyz", reduced_by, strict=True)}
    row |= {
        name: getattr(camera.identity, name)
        for name in ("body", "lens", "imu", "mount", "band", "software", "product")
    }
    row |= {f"boresight_{axis}_deg": v for axis, v in zip(_BODY, mounting.boresight_deg, strict=True)}
    head = camera.head
    row["head_of"] = None if head is None else head.reference
    for place, axis in enumerate("xyz"):
        row[f"relative_position_{axis}_m"] = None if head is None else head.position_m[place]
    for place, axis in enumerate(_BODY):
        row[f"relative_rotation_{axis}_deg"] = None if head is None else head.rotation_deg[place]
    row["synchronisation_offset_s"] = None if head is None else head.synchronisation_offset_s
    return row


class _Mounting(NamedTuple):
    """Lever arm, m, and boresight, degrees, body axes."""

    lever_arm_m: tuple[float, ...]
    boresight_deg: tuple[float, ...]


def _mounting(name: str, cameras: Mapping[str, CameraInput]) -> _Mounting:
    """The mounting of a camera; that of a head follows from its reference head: R_B(b) R(ρ), l − R_B(b) p."""
    camera = cameras[name]
    if camera.head is None:
        return _Mounting(camera.lever_arm_m, camera.boresight_deg)
    reference = cameras[camera.head.reference]
    body = rotation.from_roll_pitch_yaw(np.deg2rad(reference.boresight_deg))
    turned = body @ rotation.from_roll_pitch_yaw(np.deg2rad(camera.head.rotation_deg))
    angles = np.rad2deg(rotation.to_heading_pitch_roll(turned))[::-1]
    arm = np.array(reference.lever_arm_m) - body @ np.array(camera.head.position_m)
    return _Mounting(tuple(arm.tolist()), tuple(angles.tolist()))


_INTERIOR = (
    "camera",
    "columns",
    "rows",
    "pixel_um",
    "focal_length_mm",
    "principal_point_x_mm",
    "principal_point_y_mm",
    "pixel_origin",
    "mount_deg",
)


def frame_cameras(table: pd.DataFrame) -> dict[str, FrameCamera]:
    """The cameras of the table ``cameras`` as the mathematics knows them, by name, in its order."""
    # Not as records: of a table of one row and forty columns, those take longer than all the rest.
    columns = (table[name].tolist() for name in _INTERIOR)
    return {
        str(name): FrameCamera(
            name=str(name),
            columns=int(width),
            rows=int(height),
            pixel_size=float(pixel_um) * _UM,
            focal_length=float(c_mm) * _MM,
            principal_point=(float(x_mm) * _MM, float(y_mm) * _MM),
            pixel_origin=cast(PixelOrigin, str(origin)),
            mount_deg=int(mount_deg),
        )
        for name, width, height, pixel_um, c_mm, x_mm, y_mm, origin, mount_deg in zip(*columns, strict=True)
    }


def taken_from_registry(cameras: Mapping[str, CameraInput]) -> tuple[str, ...]:
    """Sentences about cameras that were filled: what was taken, and what was not."""
    return tuple(
        f"Camera {name} has {source.rpartition(', ')[0]} (from the registry): c "
        f"{camera.focal_length_mm:.4f} mm, principal point {_listed(camera.principal_point_mm or (), 4)} "
        f"mm, boresight {_listed(camera.boresight_deg, 5)}°, lever arm {_listed(camera.lever_arm_m, 3)} "
        f"m. {USES[camera.calibration_use]} A GNSS shift applies only to its own flight and is not used."
        for name, camera in cameras.items()
        for kind, _, source in (str(camera.calibration or "").partition(", "),)
        if kind in (REGISTRY, RIG_REGISTRY) and source
    )


def _listed(values: Sequence[float], decimals: int) -> str:
    return f"({', '.join(f'{value:.{decimals}f}' for value in values)})"
