"""The smear caused by the movement of the camera, image by image, compared with that of its edges."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.image_quality.image_motion import CameraMotion, MotionComparison, compared_with_motion
from adjust.image_quality.smear import PROBABILITY
from tasks.deliveries.cameras import frame_cameras
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.settings.image_quality import MotionSettings
from tasks.tables.schemas.image_quality import SMEAR_MOTION

_RATES = ["rate_roll_deg_s", "rate_pitch_deg_s", "rate_yaw_deg_s"]
_ATTITUDE = ["heading_deg", "pitch_deg", "roll_deg"]
_VELOCITY = ["velocity_north_m_s", "velocity_east_m_s", "velocity_up_m_s"]


def smear_motion_table(
    edges: pd.DataFrame, exposures: pd.DataFrame, cameras: pd.DataFrame, settings: MotionSettings
) -> pd.DataFrame:
    """A row for each band of each image whose edges determine a smear.

    Parameters
    ----------
    edges : contents of edges.parquet.
    exposures, cameras : contents of exposures.parquet and cameras.parquet.

    Raises
    ------
    InputError
        If an image has no exposure, or its exposure has no rates, or lacks what the forward motion needs.
    """
    known = {str(row["image"]): row for _, row in exposures.iterrows()}
    frames = frame_cameras(cameras)
    rows = []
    for (image, band), own in edges.groupby(["image", "band"], sort=False):
        exposure = known[_name_of(str(image), known)]
        camera = frames[str(exposure["camera"])]
        pixels = own[["column_px", "row_px"]].to_numpy(np.float64)
        found = compared_with_motion(
            np.deg2rad(own["normal_deg"].to_numpy(np.float64)),
            own["blur_px"].to_numpy(np.float64),
            _from_principal_point(pixels, camera),
            _motion(str(image), exposure, camera, settings),
        )
        if found is not None:
            rows.append({"image": image, "band": band, "edges": len(own), **_row(found)})
    return pd.DataFrame(rows, columns=[column.name for column in SMEAR_MOTION.columns])


def _name_of(file: str, names: Collection[str]) -> str:
    """The image that a file is: its name, with or without its ending."""
    found = next((name for name in (file, Path(file).stem) if name in names), None)
    if found is None:
        raise InputError(
            f"The image {file} is no exposure of the project.",
            did_you_mean(Path(file).stem, names),
            entity=file,
        )
    return found


def _from_principal_point(pixels: Floats, camera: FrameCamera) -> Floats:
    """Image points (n, 2) from the principal point, px, of centres of pixels counted from (0, 0)."""
    shift = 0.5 if camera.pixel_origin == "corner" else 0.0
    places = camera.image_from_pixel(pixels + shift) - np.array(camera.principal_point)
    return np.asarray(places / camera.pixel_size)


def _motion(image: str, exposure: pd.Series, camera: FrameCamera, settings: MotionSettings) -> CameraMotion:
    """How the camera moved during an exposure."""
    rates = exposure[_RATES].to_numpy(np.float64)
    if not np.isfinite(rates).all():
        raise InputError(
            f"The exposure of {image} has no angular velocities.",
            "Deliver a trajectory with rates (SBET), or the columns rate_roll, rate_pitch and rate_yaw with "
            "angles.rate_axes.",
            entity=image,
        )
    camera_from_body = camera.body_from_camera.T
    moved = np.zeros(3)
    if settings.forward_motion:
        assert settings.height_above_ground_m is not None  # the settings have made sure
        moved = camera_from_body @ _velocity_of_body(image, exposure) / settings.height_above_ground_m
    return CameraMotion(
        camera_from_body @ np.deg2rad(rates),
        np.full(3, np.deg2rad(settings.sigma_rate_deg_s)),
        moved,
        1e-3 * settings.exposure_ms,
        1e-3 * settings.sigma_exposure_ms,
        camera.focal_length / camera.pixel_size,
    )


def _velocity_of_body(image: str, exposure: pd.Series) -> Floats:
    """Velocity (3,) along the axes of the body, m/s."""
    values = exposure[[*_ATTITUDE, *_VELOCITY]].to_numpy(np.float64)
    if not np.isfinite(values).all():
        raise InputError(
            f"The exposure of {image} has no velocity with heading, pitch and roll.",
            "Deliver a trajectory, or images whose forward motion is compensated.",
            entity=image,
        )
    ned = values[3:] * np.array([1.0, 1.0, -1.0])
    return np.asarray(rotation.ned_from_body(np.deg2rad(values[:3])).T @ ned)


def _row(found: MotionComparison) -> dict[str, float | bool]:
    row: dict[str, float | bool] = {}
    for prefix, one in (("expected", found.expected), ("found", found.found)):
        row[f"{prefix}_px"] = one.length
        row[f"sigma_{prefix}_px"] = one.sigma_length
        row[f"{prefix}_deg"] = float(np.rad2deg(one.direction))
        row[f"sigma_{prefix}_deg"] = float(np.rad2deg(min(one.sigma_direction, 0.5 * np.pi)))
    row["probability"] = found.probability
    row["contradicts"] = found.probability < PROBABILITY
    return row


def smear_motion_remarks(table: pd.DataFrame) -> Iterator[str]:
    """A sentence about every band of an image whose edges contradict the movement."""
    for _, row in table[table["contradicts"]].iterrows():
        yield (
            f"{row['image']}, band {row['band']}: the edges show a smear of {row['found_px']:.2f} ± "
            f"{row['sigma_found_px']:.2f} px along {row['found_deg']:.0f}°, the trajectory one of "
            f"{row['expected_px']:.2f} ± {row['sigma_expected_px']:.2f} px along {row['expected_deg']:.0f}°. "
            "Exposure time, rates or compensation are not as declared, or something else blurs."
        )
