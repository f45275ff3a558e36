"""Crosses, taken by a camera with 15 µm of distortion, tile steps and mean residuals, lie in the undistorted image where a camera without takes them; its bytes depend on no window."""  # noqa: E501

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rasterio

from adjust.resampling.resampled import Resampling
from tasks.handover.distortion_grid import measured_points
from tasks.handover.undistorted.camera_map import CameraMap, camera_map
from tasks.handover.undistorted.undistorted_image import Work, undistort_image
from tasks.image_files.image_reader import opened_image
from tests.tasks.handover.undistorted.crosses import centres, distorting_camera, measured_centres, taken_image
from tests.tasks.image_files.images import written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, image = tmp_path_factory.mktemp("crosses") / "taken.tif", taken_image(distorting_camera())
    with rasterio.open(
        path, "w", driver="GTiff", width=image.shape[2], height=image.shape[1], count=1, dtype="uint16",
        compress="deflate", predictor=2, tiled=True, blockxsize=256, blockysize=256,
    ) as file:  # fmt: skip
        file.write(image)
    return path


@cache
def map_of(distorted: bool = True) -> CameraMap:
    return camera_map(distorting_camera(distorted=distorted))


def undistorted(taken: Path, to: Path, work: Work, *, distorted: bool = True) -> np.ndarray:
    with opened_image(taken) as source:
        undistort_image(source, map_of(distorted).pixels, to, work, lambda _: None)
    with rasterio.open(to) as file:
        return np.asarray(file.read(1))


@pytest.mark.parametrize("kind", ["cubic", "lanczos"])
def test_crosses_are_where_a_camera_without_distortion_takes_them(
    taken: Path, kind: Resampling, tmp_path: Path
) -> None:
    camera = distorting_camera()
    expected = centres(camera)
    with rasterio.open(taken) as file:
        before = np.abs(measured_centres(file.read(1), expected) - expected).max()
    away = measured_centres(undistorted(taken, tmp_path / "a.tif", Work(kind)), expected) - expected
    assert before > 2.0
    assert np.abs(away).max() < 0.01
    assert np.sqrt(np.mean(away**2)) < 0.002


def test_cameras_of_other_distortion_or_mean_residuals_have_another_digest() -> None:
    """Focal length and principal point are in the table of cameras beside it."""
    camera = distorting_camera()
    grid = camera.grid
    assert grid is not None
    others = (
        distorting_camera(distorted=False),
        replace(camera, values=camera.values * (1.0 + 1e-3)),
        replace(camera, grid=replace(grid, value=grid.value + 2e-9)),
    )
    assert len({one.digest_of_corrections for one in (camera, distorting_camera(), *others)}) == 4


def test_the_map_is_stated_to_better_than_a_hundredth_of_a_pixel() -> None:
    found = map_of()
    assert 0.0 < found.pixels.error_px < 0.01
    assert found.largest_shift_px == pytest.approx(15e-6 / 4e-6, rel=0.4)


def test_pixels_of_the_map_count_from_the_centre_of_the_first_one() -> None:
    """Also of a camera whose delivered coordinates count from its corner."""
    camera, found = distorting_camera(), map_of().pixels
    frame = camera.frame
    assert frame.pixel_origin == "corner"
    place = 64.0 * np.stack(np.meshgrid(np.arange(2.0, 12.0), np.arange(3.0, 15.0)), axis=-1).reshape(-1, 2)
    middle = 0.5 * np.array([frame.columns - 1, frame.rows - 1])
    to_metres = frame.pixel_size * np.array([1.0, -1.0])
    expected = measured_points(camera, (place - middle) * to_metres) / to_metres + middle
    column, row = place.T.astype(np.int64)
    np.testing.assert_allclose(found.at(column, row), expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["cubic", "lanczos"])
def test_bytes_depend_neither_on_the_window_nor_on_threads(
    taken: Path, kind: Resampling, tmp_path: Path
) -> None:
    made = set()
    for number, (threads, size) in enumerate([(1, 1), (1, 2_000_000), (3, 2_000_000), (2, 10**9)]):
        file = tmp_path / f"{number}.tif"
        undistorted(taken, file, Work(kind, threads, size))
        made.add(file.read_bytes())
    assert len(made) == 1


def test_a_camera_without_distortion_changes_no_byte_of_the_pixels(taken: Path, tmp_path: Path) -> None:
    made = undistorted(taken, tmp_path / "a.tif", Work(), distorted=False)
    with rasterio.open(taken) as file:
        np.testing.assert_array_equal(made, file.read(1))
    assert (tmp_path / "a.tif").read_bytes() == taken.read_bytes()


def test_a_pixel_that_is_no_number_spoils_none_around_it_in_an_image_with_a_mask(tmp_path: Path) -> None:
    frame = distorting_camera().frame
    data = np.full((1, frame.rows, frame.columns), 5.0, np.float32)
    data[0, 200, 300] = np.nan
    taken = written(tmp_path / "taken.tif", data)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(taken, "r+") as file:
        mask = np.ones(data.shape[1:], dtype=bool)
        mask[:50] = False
        file.write_mask(mask)
    made = undistorted(taken, tmp_path / "a.tif", Work("lanczos"))
    with rasterio.open(tmp_path / "a.tif") as file:
        valid = file.read_masks(1) != 0
    assert 1 <= np.isnan(made).sum() <= 4
    np.testing.assert_array_equal(made[valid], 5.0)
