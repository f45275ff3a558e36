"""A camera calibration in a test field, simulated: convergent images with quarter turns, in text files.

Formulas of its own: collinearity with rotations made of three axes, and Brown's radial distortion.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats

COLUMNS, ROWS, PIXEL_MM = 6000, 4000, 0.004
FOCAL_LENGTH_MM, PRINCIPAL_POINT_MM, K1 = 24.3, (0.06, -0.04), 1.2e-4  # of the truth; K1 per mm²
APPROXIMATE_MM = 24.0
SIGMA_PX = 0.1
CONTROL = 20


@dataclass(frozen=True, eq=False)
class CloseRange:
    """The truth: images (n, 3) and (n, 3, 3), targets (m, 3), metres."""

    projection_centre: Floats
    local_from_camera: Floats
    target: Floats

    @property
    def images(self) -> list[str]:
        """Names, in the order of the images."""
        return [f"IMG_{number:03d}" for number in range(len(self.projection_centre))]

    @property
    def targets(self) -> list[str]:
        """Names, in the order of the targets."""
        return [f"T{number:03d}" for number in range(len(self.target))]


def close_range(images: int, targets: int, relief: float, generator: np.random.Generator) -> CloseRange:
    """Images from all sides about 3 m above a field of 2 m × 2 m, turned by 0, 90, 180 and 270°."""
    side = int(np.ceil(np.sqrt(targets)))
    grid = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, side), np.linspace(-1.0, 1.0, side)), -1).reshape(
        -1, 2
    )
    plan = grid[:targets] + 0.03 * generator.standard_normal((targets, 2))
    target = np.column_stack([plan, relief * generator.random(targets)])
    azimuth = 2.0 * np.pi * (np.arange(images) * 0.381966 % 1.0)
    tilt = np.deg2rad(generator.uniform(5.0, 45.0, images))
    distance = generator.uniform(2.6, 3.4, images)
    aim = np.column_stack([0.2 * generator.standard_normal((images, 2)), np.zeros(images)])
    backwards = np.column_stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)]
    )
    rotations = [
        _looking(axis, 0.5 * np.pi * (k % 4) + 0.1 * generator.standard_normal())
        for k, axis in enumerate(backwards)
    ]
    return CloseRange(aim + distance[:, None] * backwards, np.array(rotations), target)


def _looking(backwards: Floats, roll: float) -> Floats:
    """Rotation local from camera whose z is a direction, turned about it."""
    x = np.cross([0.0, 1.0, 0.0], backwards)
    x /= np.linalg.norm(x)
    y = np.cross(backwards, x)
    return np.column_stack(
        [np.cos(roll) * x + np.sin(roll) * y, np.cos(roll) * y - np.sin(roll) * x, backwards]
    )


def image_points(truth: CloseRange, generator: np.random.Generator) -> pd.DataFrame:
    """Measured columns and rows of all targets inside the images."""
    rows = []
    x0, y0 = PRINCIPAL_POINT_MM
    for name, centre, rotation in zip(
        truth.images, truth.projection_centre, truth.local_from_camera, strict=True
    ):
        p = (truth.target - centre) @ rotation
        ideal = -FOCAL_LENGTH_MM * p[:, :2] / p[:, 2:]
        distorted = ideal.copy()
        for _ in range(50):  # measured + K1 r² measured = ideal
            distorted = ideal / (1.0 + K1 * np.sum(distorted**2, axis=1, keepdims=True))
        column = (distorted[:, 0] + x0) / PIXEL_MM + 0.5 * COLUMNS
        row = 0.5 * ROWS - (distorted[:, 1] + y0) / PIXEL_MM
        pixel = np.column_stack([column, row]) + SIGMA_PX * generator.standard_normal((len(p), 2))
        inside = ((pixel > 0.0) & (pixel < [COLUMNS, ROWS])).all(axis=1)
        rows += [(name, truth.targets[j], *pixel[j]) for j in np.flatnonzero(inside)]
    return pd.DataFrame(rows, columns=["image", "point", "x", "y"])


def with_scale_bars(
    folder: Path, truth: CloseRange, bars: int, sigma_m: float, generator: np.random.Generator
) -> None:
    """The project of `write_project` without control points, in the place of which distances.csv gives scale.

    In millimetres; every third is a check distance.
    """
    ends = generator.choice(len(truth.target), (bars, 2), replace=False)
    true = np.linalg.norm(truth.target[ends[:, 0]] - truth.target[ends[:, 1]], axis=1)
    names = np.array(truth.targets)[ends]
    pd.DataFrame(
        {
            "point": names[:, 0],
            "other_point": names[:, 1],
            "distance": (true + sigma_m * generator.standard_normal(bars)) * 1e3,
            "role": ["check" if k % 3 == 2 else "control" for k in range(bars)],
        }
    ).to_csv(folder / "distances.csv", index=False)
    project = folder / "project.toml"
    text = project.read_text()
    start, end = text.index("[inputs.control]"), text.index("[adjustment]")
    bar = f'[inputs.distances]\nfile = "distances.csv"\nunit = "mm"\nsigma = {sigma_m * 1e3}\n'
    text = text[:start] + bar + text[end:]
    text = text.replace('observe = ["control"]', 'datum = "free_network"\nobserve = []')
    project.write_text(text)


def write_project(
    folder: Path, truth: CloseRange, control_sigma_m: float, generator: np.random.Generator
) -> None:
    """project.toml, image_points.csv and control.csv: a camera of which only an approximate c is known."""
    image_points(truth, generator).to_csv(folder / "image_points.csv", index=False)
    chosen = np.linspace(0, len(truth.target) - 1, CONTROL).astype(int)
    x, y, z = (truth.target[chosen] + control_sigma_m * generator.standard_normal((CONTROL, 3))).T
    names = [truth.targets[j] for j in chosen]
    pd.DataFrame({"point": names, "x": x, "y": y, "z": z}).to_csv(folder / "control.csv", index=False)
    (folder / "project.toml").write_text(
        f"""version = 1
[project]
name = "test field"
crs = "local"
[cameras.NIKON]
columns = {COLUMNS}
rows = {ROWS}
pixel_um = {PIXEL_MM * 1e3}
focal_length_mm = {APPROXIMATE_MM}
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "image_points.csv"
format = "csv"
unit = "px"
sigma = {SIGMA_PX}
[inputs.control]
file = "control.csv"
format = "csv"
crs = "local"
sigma_m = {control_sigma_m}
[adjustment]
observe = ["control"]
free = ["focal_length", "principal_point"]
refraction = "none"
rejection = "none"
self_calibration = {{ parameters = "brown_mm:K1-P2", elimination = "none" }}
[calibration]
variance_components = false
"""
    )
