"""``aerocal image-quality`` on images that moved while exposed, against the rates of the trajectory."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.image_quality.edge_model import edge_values
from tasks.image_files.image_reader import raster_environment
from tests.adjust.image_quality.synthetic_edges import unit_edge
from tests.command_line import aerocal

SIZE, FOCAL, TIME, BLUR = 480, 16_000.0, 0.002, 0.45
#: °/s about the axes forward, right, down.
RATES = {"A": (2.0, 1.2, 6.0), "B": (-1.0, 2.6, -4.0), "C": (0.0, 0.0, 0.0)}
MOUNT = 90


def moved(place: Floats, rate_deg: tuple[float, ...], time: float) -> Floats:
    """Place (2,) of an image point from the principal point, px, at a time; by exact projection."""
    body_from_camera = np.diag([1.0, -1.0, -1.0]) @ rotation.about_z(np.deg2rad(MOUNT))
    rate = body_from_camera.T @ np.deg2rad(rate_deg)
    seen = np.array([*place / FOCAL, -1.0]) @ rotation.exp(time * rate)
    return np.asarray(-FOCAL * seen[:2] / seen[2])


def exposed(rate_deg: tuple[float, ...], seed: int) -> Floats:
    """Bright squares, turned differently, averaged over the exposure."""
    rng = np.random.default_rng(seed)
    image = np.full((SIZE, SIZE), 90.0)
    row, column = np.mgrid[-80:80, -80:80].astype(np.float64)
    times = TIME * ((np.arange(7) + 0.5) / 7 - 0.5)
    for top in range(0, SIZE, 160):
        for left in range(0, SIZE, 160):
            turn, middle = np.deg2rad(rng.uniform(3.0, 42.0)), rng.uniform(-20.0, 20.0, 2)
            at = np.array([left + 80.0 + middle[0], top + 80.0 + middle[1]]) - 0.5 * (SIZE - 1)
            place = at * np.array([1.0, -1.0])
            square = np.zeros(row.shape)
            for time in times:
                shift = (moved(place, rate_deg, time) - place) * np.array([1.0, -1.0])
                one = np.ones(row.shape)
                for quarter in range(4):
                    angle = turn + quarter * 0.5 * np.pi
                    across, down = column - middle[0] - shift[0], row - middle[1] - shift[1]
                    distance = 30.0 - across * np.cos(angle) - down * np.sin(angle)
                    one *= unit_edge(
                        distance, BLUR, lambda near, at=angle: edge_values(near, BLUR**2, at).value
                    )
                square += one / len(times)
            image[top : top + 160, left : left + 160] += 100.0 * square
    return image + rng.normal(0.0, 1.0, image.shape)


PROJECT = f"""version = 1
[project]
name = "Motion"
crs = "local"
[cameras.C]
columns = {SIZE}
rows = {SIZE}
pixel_um = 5.0
focal_length_mm = {5e-3 * FOCAL}
principal_point_mm = [0.0, 0.0]
pixel_origin = "centre"
mount_deg = {MOUNT}
[[inputs.exposures]]
file = "exposures.csv"
format = "csv"
crs = "local"
position = "projection_centre"
[inputs.exposures.angles]
order = "heading-pitch-roll"
unit = "deg"
reference = "local"
rate_axes = "forward-right-down"
[[inputs.image_points]]
file = "points.csv"
format = "csv"
unit = "px"
[image_quality]
images = ["A.tif", "B.tif", "C.tif"]
[image_quality.motion]
exposure_ms = {1e3 * TIME}
forward_motion = false
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motion")
    size = {"driver": "GTiff", "width": SIZE, "height": SIZE, "count": 1, "dtype": "uint8"}
    lines = ["image,camera,strip,x,y,z,heading,pitch,roll,rate_roll,rate_pitch,rate_yaw"]
    for seed, (name, rate) in enumerate(RATES.items()):
        pixels = np.clip(np.rint(exposed(rate, seed)), 1, 254).astype(np.uint8)
        with raster_environment() as rasterio, rasterio.open(folder / f"{name}.tif", "w", **size) as file:
            file.write(pixels[None])
        lines.append(f"{name},C,1,{100 * seed},0,1000,90,0,0,{','.join(map(str, rate))}")
    (folder / "exposures.csv").write_text("\n".join(lines) + "\n")
    (folder / "points.csv").write_text("image,point,column,row\n")
    (folder / "project.toml").write_text(PROJECT)
    return folder / "project.toml"


@pytest.fixture(scope="module")
def examined(project: Path) -> Path:
    """Results of the project."""
    outcome = aerocal("image-quality", project)
    assert outcome.returncode == 0, outcome.stderr
    return project.parent / "image-quality"


@pytest.fixture
def copied(examined: Path, tmp_path: Path) -> Path:
    """The project file of a copy with its results: edges are not measured again."""
    return Path(shutil.copytree(examined.parent, tmp_path / "copy")) / "project.toml"


def test_edges_and_rates_agree(examined: Path) -> None:
    out = examined
    table = pd.read_parquet(out / "smear_motion.parquet").set_index("image")
    assert list(table.index) == ["A.tif", "B.tif", "C.tif"]
    assert not table["contradicts"].any()
    for name in ("A.tif", "B.tif"):
        row = table.loc[name]
        assert row["expected_px"] > 1.0
        sigma = np.hypot(row["sigma_found_px"], row["sigma_expected_px"])
        assert row["found_px"] == pytest.approx(row["expected_px"], abs=3.3 * sigma + 0.01)
        turned = (row["found_deg"] - row["expected_deg"] + 90.0) % 180.0 - 90.0
        assert abs(turned) < 3.3 * row["sigma_found_deg"] + 1.0
    assert table.loc["C.tif", "expected_px"] == 0.0
    assert "from the trajectory" in (out / "image_quality.html").read_text()


def test_an_exposure_time_that_is_wrong_contradicts_the_edges(copied: Path) -> None:
    outcome = aerocal("image-quality", copied, "--set", "image_quality.motion.exposure_ms=4.0")
    assert outcome.returncode == 0
    table = pd.read_parquet(copied.parent / "image-quality" / "smear_motion.parquet").set_index("image")
    assert table["contradicts"].tolist() == [True, True, False]
    assert "the trajectory one of" in outcome.stdout


def test_images_of_no_exposure_and_exposures_without_rates_are_refused(copied: Path, tmp_path: Path) -> None:
    text, exposures = copied.read_text(), copied.parent / "exposures.csv"
    copied.write_text(text.replace('"C.tif"', '"exposures.csv"'))
    outcome = aerocal("image-quality", copied)
    assert outcome.returncode == 2
    assert "This image cannot be read" in outcome.stderr
    copied.write_text(text)
    exposures.write_text(exposures.read_text().replace("B,C", "D,C"))
    outcome = aerocal("image-quality", copied)
    assert outcome.returncode == 2
    assert "B.tif is no exposure" in outcome.stderr
    alone = tmp_path / "alone.toml"
    alone.write_text(
        f'version = 1\n[image_quality]\nimages = "{copied.parent / "A.tif"}"\n'
        "[image_quality.motion]\nexposure_ms = 2.0\nforward_motion = false\n"
    )
    outcome = aerocal("image-quality", alone)
    assert outcome.returncode == 2
    assert "belong to no project" in outcome.stderr
