"""``aerocal undistort``: images of a calibrated block, and what is refused before one is written."""

from __future__ import annotations

import csv
import fcntl
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rasterio

from adjust.arrays import Floats
from tasks.handover.distortion_grid import measured_points
from tasks.handover.results import read_cameras, read_results
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.conftest import Start
from tests.tasks.image_files.images import pixels, written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
COLUMNS, ROWS = 654, 1001
#: 16 images of large pixels with radial errors and shifted CCD images.
SMALL = (
    f"camera.columns={COLUMNS}", f"camera.rows={ROWS}", "camera.pixel_um=104.0",
    "project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=9.3",
    "flight.0.exposures=4", "flight.1.exposures=4", "points.count=500", "terrain.mean_m=400",
    "truth.image_errors.radial_um=120.0", "truth.image_errors.tile_um=15.0",
)  # fmt: skip
SETTINGS = (
    'adjustment.free=["focal_length", "principal_point", "boresight", "gnss_shift"]',
    "adjustment.residual_grid.iterations=2", "adjustment.residual_grid.cross_validation=false",
    'adjustment.self_calibration.parameters="brown:K1,K2,P1,P2"',
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibrated")
    project = simulate_project(load_simulation("uce-high", SMALL), folder / "b").project_file
    words = [word for setting in SETTINGS for word in ("--set", setting)]
    done = aerocal("adjust", project, "--out", folder / "results", *words)
    assert done.returncode == 0, done.stderr
    return folder / "results"


@pytest.fixture(scope="module")
def name(results: Path) -> str:
    """Of an image of the block."""
    return read_results(results).images.names[2]


#: Seventh pixels: every place of a cell of the resampling, as its size is no multiple of 7.
EVERY = np.s_[10:-10:7, 10:-10:7]


def sources(results: Path) -> Floats:
    """(r, c, 2) where in a taken image pixels of an undistorted one are."""
    (camera,) = read_cameras(results)[0].values()
    frame = camera.frame
    row, column = (index[EVERY] for index in np.indices((ROWS, COLUMNS)))
    away = np.stack([column - (COLUMNS - 1) / 2, (ROWS - 1) / 2 - row], axis=-1).reshape(-1, 2)
    measured = measured_points(camera, away * frame.pixel_size) / frame.pixel_size
    place = measured * [1.0, -1.0] + [(COLUMNS - 1) / 2, (ROWS - 1) / 2]
    return np.asarray(place.reshape(*row.shape, 2))


def test_pixels_show_what_the_camera_saw_in_its_direction(results: Path, name: str, tmp_path: Path) -> None:
    row, column = np.indices((ROWS, COLUMNS)).astype(np.float32)
    image = written(tmp_path / f"{name}.tif", np.stack([column, row]))
    done = aerocal("undistort", results, image, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    with rasterio.open(tmp_path / "out" / image.name) as file:
        found = np.moveaxis(file.read(), 0, 2)
    expected = sources(results)
    assert np.abs(expected - np.stack([column, row], axis=2)[EVERY]).max() > 1.0
    assert np.abs(found[EVERY] - expected).max() < 0.01

    (camera,) = csv.DictReader((tmp_path / "out" / "cameras.csv").read_text().splitlines())
    (calibrated,) = read_cameras(results)[0].values()
    assert float(camera["focal_length_mm"]) == pytest.approx(1e3 * calibrated.frame.focal_length, abs=1e-7)
    assert camera["corrections"] == calibrated.digest_of_corrections
    assert float(camera["x0_mm"]) == pytest.approx(1e3 * calibrated.frame.principal_point[0], abs=1e-7)
    text = " ".join((tmp_path / "out" / "UNDISTORTED.txt").read_text().split())
    assert f"parameters change image points by up to {1e6 * calibrated.largest_distortion:.1f} µm" in text
    assert "NOT contained: refraction" in text
    assert f"{image.name}: camera {camera['camera']}" in text
    assert text.split()[:3] == done.stdout.split()[:3]


def test_images_of_other_formats_and_blocks_are_written_too(results: Path, name: str, tmp_path: Path) -> None:
    data = pixels(3, ROWS, COLUMNS, "uint8")
    png = written(tmp_path / f"{name}.png", data, driver="PNG")
    other = written(tmp_path / "other.TIF", data[:1])
    (camera,) = read_cameras(results)[0]
    done = aerocal(
        "undistort",
        results,
        png,
        other,
        "--camera",
        camera,
        "--resampling",
        "lanczos",
        "--out",
        tmp_path / "o",
    )
    assert done.returncode == 0, done.stderr
    made = {path.name for path in (tmp_path / "o").iterdir()}
    assert made == {f"{name}.tif", "other.TIF", "cameras.csv", "UNDISTORTED.txt"}
    with (
        rasterio.open(tmp_path / "o" / f"{name}.tif") as one,
        rasterio.open(tmp_path / "o" / "other.TIF") as two,
    ):
        np.testing.assert_array_equal(one.read(1), two.read(1))


def test_a_band_that_its_file_calls_alpha_is_named(results: Path, name: str, tmp_path: Path) -> None:
    """Near infrared is called so by programs that write four bands of 8 bits without being told otherwise."""
    image = written(tmp_path / f"{name}.tif", pixels(4, ROWS, COLUMNS, "uint8"))
    done = aerocal("undistort", results, image, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "UNDISTORTED.txt").read_text()
    assert "; band 4 is alpha by its file: it says which pixels are valid" in " ".join(text.split())


def test_what_does_not_fit_is_refused_before_anything_is_written(
    results: Path, name: str, tmp_path: Path
) -> None:
    fits = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8"))
    (tmp_path / "a").mkdir()
    turned = written(tmp_path / "a" / f"{name}.tif", pixels(1, COLUMNS, ROWS, "uint8"))
    small = written(tmp_path / "a" / f"{name}.tiff", pixels(1, 20, 30, "uint8"))
    strange = written(tmp_path / "strange.tif", pixels(1, ROWS, COLUMNS, "uint8"))
    out = tmp_path / "out"
    cases = [
        ([turned], "1,001 × 654 pixels, and the camera UCE-80 654 × 1,001."),
        ([fits, small], "30 × 20 pixels"),
        ([fits, strange], "no adjusted image of this name"),
        ([fits, fits], "as would"),
        ([fits, tmp_path / "none.tif"], "no such file"),
        ([tmp_path], f"This is a folder, not an image. Name its images: {tmp_path}/*.tif."),
        ([tmp_path / "a"], f"Name its images: {tmp_path}/a/*.tif {tmp_path}/a/*.tiff."),
        ([results], "There is no image in it"),
        ([fits, results / "cameras.parquet"], "This image cannot be read"),
        ([fits, "--camera", "UC"], "no camera 'UC'"),
        ([fits, "--resampling", "nearest"], "'nearest' is not known"),
        ([fits, "--out", tmp_path], "overwrite itself"),
        ([fits, "--out", fits], "a file, not a folder"),
    ]  # fmt: skip
    for words, sentence in cases:
        where = [] if "--out" in words else ["--out", out]
        done = aerocal("undistort", results, *words, *where)
        assert done.returncode == 2, (words, done.stdout)
        assert sentence in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        assert not out.exists()
    done = aerocal("undistort", tmp_path, fits, "--out", out)
    assert done.returncode == 2
    assert "no results of a run" in done.stderr


def test_an_image_that_is_damaged_is_named_and_not_left_half(
    results: Path, name: str, tmp_path: Path
) -> None:
    path = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8"), compress="deflate")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 20_000] = bytes(20_000)
    path.write_bytes(content)
    done = aerocal("undistort", results, path, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert f"{path.name}: The image cannot be read in rows" in done.stderr
    assert not list((tmp_path / "out").iterdir())


def test_a_killed_process_leaves_no_image_and_the_next_one_no_trace_of_it(
    start: Start, results: Path, name: str, tmp_path: Path
) -> None:
    # To write 42 MB takes longer than to look whether it has begun.
    data = np.tile(pixels(1, ROWS, COLUMNS, "float64"), (8, 1, 1))
    path, out = written(tmp_path / f"{name}.tif", data), tmp_path / "out"
    command = (sys.executable, "-m", "flows.command", "undistort", results, path, "--out", out)
    process = start(*command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not any(part.stat().st_size for part in out.glob(".aerocal.*.part")):
        assert process.poll() is None
        time.sleep(0.002)
    process.kill()
    process.wait()
    assert len(list(out.iterdir())) == 1
    assert not (out / path.name).exists()
    done = aerocal("undistort", results, path, "--out", out)
    assert done.returncode == 0, done.stderr
    assert {file.name for file in out.iterdir()} == {path.name, "cameras.csv", "UNDISTORTED.txt"}


def test_a_folder_of_others_is_left_as_it_is(results: Path, name: str, tmp_path: Path) -> None:
    """Their images, and the cameras of an undistortion with another calibration."""
    image = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8"))
    for file, sentence in ((image.name, "It exists already"), ("cameras.csv", "images of other cameras")):
        theirs = tmp_path / file.partition(".")[0] / file
        theirs.parent.mkdir()
        theirs.write_bytes(b"theirs")
        done = aerocal("undistort", results, image, "--out", theirs.parent)
        assert done.returncode == 2, done.stdout
        assert f"{theirs}: " in done.stderr
        assert sentence in done.stderr
        assert [one.read_bytes() for one in theirs.parent.iterdir()] == [b"theirs"]


def test_every_image_of_a_folder_is_stated_whichever_call_has_written_it(
    results: Path, tmp_path: Path
) -> None:
    data, out = pixels(1, ROWS, COLUMNS, "uint8"), tmp_path / "out"
    (camera,) = read_cameras(results)[0]
    kinds = {"a.tif": "cubic", "b.tif": "lanczos", "d.tif": "cubic"}
    for file, kind in kinds.items():
        image = written(tmp_path / file, data)
        words = ("--camera", camera, "--out", out, "--resampling", kind)
        done = aerocal("undistort", results, image, *words)
        assert done.returncode == 0, done.stderr
        assert [other in done.stdout for other in kinds] == [other == file for other in kinds]
        (out / "d.tif").unlink(missing_ok=True)
    aerocal("undistort", results, tmp_path / "a.tif", *words[:4], "--resampling", "lanczos")
    *parts, images = (out / "UNDISTORTED.txt").read_text().split("\n\n")
    assert sum(part.startswith("Camera ") for part in parts) == 1
    assert [line.split(";")[:2] for line in images.splitlines()] == [
        [f"{file}: camera {camera}", " Lanczos' window (6 x 6 pixels)"] for file in ("a.tif", "b.tif")
    ]


def waiting_for_another(
    start: Start, results: Path, image: Path, out: Path
) -> tuple[int, subprocess.Popen[bytes]]:
    """The lock of another call on a folder, and a call that has written an image into it and waits."""
    out.mkdir()
    other = os.open(out, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    command = (sys.executable, "-m", "flows.command", "undistort", results, image, "--out", out)
    process = start(*command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not (out / image.name).exists():
        assert process.poll() is None
        time.sleep(0.01)
    return other, process


def test_a_call_waits_for_another_one_that_states_its_images(
    start: Start, results: Path, name: str, tmp_path: Path
) -> None:
    """Otherwise each would state what it has read before the other one, and one image would be lost."""
    image, out = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8")), tmp_path / "out"
    other, process = waiting_for_another(start, results, image, out)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(2.0)
    (out / "UNDISTORTED.txt").write_text("Of another call.\n\nother.tif: camera A; cubic\n")
    (out / "other.tif").touch()
    os.close(other)
    assert process.wait() == 0
    stated = (out / "UNDISTORTED.txt").read_text().split("\n\n")[-1]
    assert [line.partition(":")[0] for line in stated.splitlines()] == ["other.tif", image.name]


def test_an_image_is_left_out_where_another_call_has_begun_with_other_cameras(
    start: Start, results: Path, name: str, tmp_path: Path
) -> None:
    image, out = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8")), tmp_path / "out"
    other, process = waiting_for_another(start, results, image, out)
    (out / "cameras.csv").write_bytes(b"theirs")
    os.close(other)
    assert process.wait() == 2
    assert {file.name for file in out.iterdir()} == {"cameras.csv"}
    assert (out / "cameras.csv").read_bytes() == b"theirs"


def test_an_image_is_written_again_over_its_own_result(results: Path, name: str, tmp_path: Path) -> None:
    image = written(tmp_path / f"{name}.tif", pixels(1, ROWS, COLUMNS, "uint8"))
    for _ in range(2):
        done = aerocal("undistort", results, image, "--out", tmp_path / "out")
        assert done.returncode == 0, done.stderr
