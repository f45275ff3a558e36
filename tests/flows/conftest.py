"""A small synthetic block as a user would deliver it: two strips of four images, text files, a project."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation

COLUMNS, ROWS, PIXEL_UM, FOCAL_LENGTH_MM = 10_000, 8_000, 5.0, 50.0
HEIGHT_M, BASE_M, STRIP_DISTANCE_M = 1000.0, 400.0, 450.0
PIXEL_SIGMA, GNSS_SIGMA_M, ANGLE_SIGMA_DEG = 0.3, 0.05, 0.003

PROJECT = f"""
version = 1
[project]
name = "two strips"
crs = "local"
heights = "ellipsoidal"
[cameras.C]
columns = {COLUMNS}
rows = {ROWS}
pixel_um = {PIXEL_UM}
focal_length_mm = {FOCAL_LENGTH_MM}
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "image_points.csv"
format = "csv"
unit = "px"
sigma = {PIXEL_SIGMA}
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
position = "projection_centre"
angles = {{ order = "omega-phi-kappa", unit = "deg", reference = "grid" }}
sigma = {{ position_m = {GNSS_SIGMA_M}, attitude_deg = {ANGLE_SIGMA_DEG} }}
[inputs.control]
file = "control.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
sigma_m = 0.02
[adjustment]
free = ["boresight"]
rejection = "none"
[gates]
sigma0 = {{ min = 0.7, max = 1.3 }}
"""


def _rotation(omega: float, phi: float, kappa: float) -> np.ndarray:
    """R_x(ω) R_y(φ) R_z(κ), camera → ground, written out independently of the package."""
    (so, sp, sk), (co, cp, ck) = np.sin([omega, phi, kappa]), np.cos([omega, phi, kappa])
    about_x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z


def _pixels(centre: np.ndarray, angles_deg: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Column and row (corner convention) of object points in an image; NaN outside of it."""
    in_camera = (points - centre) @ _rotation(*np.radians(angles_deg))
    xy_mm = -FOCAL_LENGTH_MM * in_camera[:, :2] / in_camera[:, 2:]
    pixels = np.array([COLUMNS / 2, ROWS / 2]) + xy_mm * [1000 / PIXEL_UM, -1000 / PIXEL_UM]
    inside = np.all((pixels > 5) & (pixels < np.array([COLUMNS, ROWS]) - 5), axis=1)
    return np.where(inside[:, None], pixels, np.nan)


def write_block(folder: Path) -> Path:
    """Write deliveries and project file of the synthetic block into a folder."""
    random = np.random.default_rng(20)
    east, north = np.meshgrid(np.arange(-500.0, 1700.0, 80.0), np.arange(-350.0, 800.0, 80.0))
    flat = np.column_stack([east.ravel(), north.ravel()])
    points = np.column_stack([flat + random.uniform(-20, 20, flat.shape), random.uniform(0, 60, len(flat))])
    exposures = ["image,camera,strip,x,y,z,omega,phi,kappa"]
    measured: dict[str, list[str]] = {}
    for strip, image in np.ndindex(2, 4):
        centre = np.array([image * BASE_M, strip * STRIP_DISTANCE_M, HEIGHT_M]) + random.normal(0, 5, 3)
        angles = np.array([0.0, 0.0, 178.0 * strip]) + random.normal(0, 0.5, 3)
        name = f"{strip + 1}_{image + 1:03d}"
        given = [
            *(centre + random.normal(0, GNSS_SIGMA_M, 3)),
            *(angles + random.normal(0, ANGLE_SIGMA_DEG, 3)),
        ]
        exposures.append(f"{name},C,{strip + 1}," + ",".join(f"{value:.6f}" for value in given))
        pixels = _pixels(centre, angles, points) + random.normal(0, PIXEL_SIGMA, (len(points), 2))
        for point in np.flatnonzero(np.isfinite(pixels[:, 0])):
            column, row = pixels[point]
            measured.setdefault(f"p{point}", []).append(f"{name},p{point},{column:.3f},{row:.3f}")
    tied = {name: rows for name, rows in measured.items() if len(rows) > 1}
    by_rays = sorted(tied, key=lambda name: (-len(tied[name]), name))[:40:8]
    control = ["point,x,y,z,role"]
    for order, name in enumerate(by_rays):
        x, y, z = points[int(name[1:])] + random.normal(0, 0.02, 3)
        control.append(f"{name},{x:.4f},{y:.4f},{z:.4f},{'check' if order == 0 else 'control'}")
    folder.mkdir(parents=True, exist_ok=True)
    rows = [row for name in tied for row in tied[name]]
    (folder / "image_points.csv").write_text("\n".join(["image,point,x,y", *rows]) + "\n")
    (folder / "exposures.csv").write_text("\n".join(exposures) + "\n")
    (folder / "control.csv").write_text("\n".join(control) + "\n")
    (folder / "project.toml").write_text(PROJECT)
    return folder / "project.toml"


@pytest.fixture
def block(tmp_path: Path) -> Path:
    """Project file of the synthetic block, alone in its folder."""
    return write_block(tmp_path / "block")


@pytest.fixture(scope="session")
def run_before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the synthetic block with the results of a run."""
    project = write_block(tmp_path_factory.mktemp("run_before") / "block")
    outcome = carry_out(aerial_triangulation, RunRequest(project))
    assert outcome.error is None, outcome.error
    return project.parent


@pytest.fixture
def warm_block(run_before: Path, tmp_path: Path) -> Path:
    """Project file of a copy of the block after a run: a test's own run computes what it changes."""
    return Path(shutil.copytree(run_before, tmp_path / "block")) / "project.toml"
