"""Rows of blocks of an image that are in memory at a time."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import rasterio

from adjust.arrays import Floats
from adjust.resampling.pixel_map import pixel_map
from tasks.handover.undistorted.undistorted_image import Work, coding_threads, undistort_image
from tasks.image_files.image_reader import ImageReader, described, opened_image
from tests.tasks.image_files.images import pixels, written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
BANDS, ROWS, COLUMNS, BLOCK = 4, 512, 2048, 128


def most_memory(folder: Path, shape: tuple[int, int, int], block: tuple[int, int]) -> int:
    """Bytes at most while an image of 16 bits (bands, rows, columns) in blocks (columns, rows) is moved."""
    most = 0
    # A small one before, as compiling needs memory of its own.
    for rows, columns in ((16, 16), shape[1:]):
        data = pixels(shape[0], rows, columns, "uint16")
        tiles = {"tiled": True, "blockxsize": block[0], "blockysize": block[1]}
        path = written(folder / "a.tif", data, nodata=7, **tiles)
        moved = pixel_map(lambda place: place + np.array([0.3, 0.4]), (columns, rows), (columns, rows))
        with opened_image(path) as source:
            tracemalloc.start()
            undistort_image(source, moved, folder / "b.tif", Work(strip_bytes=1), lambda _: None)
            _, most = tracemalloc.get_traced_memory()
            tracemalloc.stop()
    return most


def test_two_rows_of_blocks_are_read_without_a_second_copy(tmp_path: Path) -> None:
    """Four bands of 16 bits with a value for no data: 3.1 rows of blocks; 5.8 with the validity of all."""
    most = most_memory(tmp_path, (BANDS, ROWS, COLUMNS), (BLOCK, BLOCK))
    assert most < 4.0 * 2 * BANDS * BLOCK * COLUMNS


def test_of_a_row_of_large_tiles_its_source_is_in_memory_and_some_columns_of_the_result(
    tmp_path: Path,
) -> None:
    """1.5 rows of tiles with a value for no data, where 4.1 were."""
    most = most_memory(tmp_path, (4, 2560, 2048), (128, 1024))
    assert most < 1.8 * 2 * 4 * 1024 * 2048


def test_fewer_threads_code_larger_tiles(tmp_path: Path) -> None:
    """Each holds one or two: of four bands of 16 bits and 2,048 rows, 34 MB."""
    found = []
    for side in (512, 1024, 2048):
        tiles = {"tiled": True, "blockxsize": side, "blockysize": side, "sparse_ok": True}
        path = written(tmp_path / f"{side}.tif", np.zeros((4, 32, 32), np.uint16), **tiles)
        found.append(coding_threads(described(path), 16))
    assert found == [16, 5, 1]


_KINDS = {
    "bands together": {"compress": "deflate", "predictor": 2},
    "band by band": {"interleave": "band", "compress": "zstd"},
    "no data": {"nodata": 7},
    "no data, band by band": {"interleave": "band", "nodata": 7},
    "alpha, band by band": {"interleave": "band", "photometric": "rgb", "alpha": "yes"},
}


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("kind", _KINDS)
def test_bytes_do_not_depend_on_the_columns_at_a_time(kind: str, masked: bool, tmp_path: Path) -> None:
    data = pixels(4, 300, 500, "float32" if masked else "uint8")
    if masked:
        data[1, 100:103, 250:400:7] = np.nan
    path = written(tmp_path / "a.tif", data, tiled=True, blockxsize=128, blockysize=256, **_KINDS[kind])
    if masked:
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as file:
            file.write_mask(data[0] > 40)

    def source_of(place: Floats) -> Floats:
        return place + [3.3, -2.4] + 2e-5 * (place - [250, 100]) ** 2 + 3.0 * (place > [261.3, 133.3])

    moved, made, out = pixel_map(source_of, (500, 300), (500, 300)), set(), tmp_path / "b.tif"
    for size in (1, 600_000, 10**9):
        with opened_image(path) as source:
            outside = undistort_image(source, moved, out, Work(strip_bytes=size), lambda _: None)
        made.add((outside, out.read_bytes()))
    assert len(made) == 1
    with rasterio.open(out) as file:
        assert len({band.tobytes() for band in file.read()}) == 4


class _Counted(ImageReader):
    """Counts how often rows of blocks are decoded."""

    def read(self, rows, columns=None, out=None):
        high = self.description.block_rows
        DECODED.update(range(rows[0] // high, -(-rows[1] // high)))
        return super().read(rows, columns, out)


DECODED: Counter[int] = Counter()


@pytest.mark.parametrize("block", [256, 1024])
def test_high_tiles_that_are_written_in_lower_ones_are_decoded_once(tmp_path: Path, block: int) -> None:
    """Those of JPEG 2000; tiles of 1,024 rows were decoded four times."""
    data = pixels(1, 3000, 64, "uint8")
    options = {"blockxsize": block, "blockysize": block, "quality": 100, "reversible": True}
    path = written(tmp_path / "a.jp2", data, driver="JP2OpenJPEG", **options)
    moved = pixel_map(lambda place: place + np.array([0.3, 0.4]), (64, 3000), (64, 3000))
    DECODED.clear()
    with opened_image(path) as source:
        assert source.description.block_rows == block
        counted = _Counted(source.description, source.dataset)
        undistort_image(counted, moved, tmp_path / "b.tif", Work(strip_bytes=1), lambda _: None)
    assert dict.fromkeys(range(-(-3000 // block)), 1) == DECODED
