"""Rows of blocks of an image that are in memory at a time."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from adjust.resampling.pixel_map import pixel_map
from tasks.handover.undistorted.undistorted_image import Work, undistort_image
from tasks.image_files.image_reader import ImageReader, opened_image
from tests.tasks.image_files.images import pixels, written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
BANDS, ROWS, COLUMNS, BLOCK = 4, 512, 2048, 128


def test_two_rows_of_blocks_are_read_without_a_second_copy(tmp_path: Path) -> None:
    """Four bands of 16 bits with a value for no data: 5.8 rows of blocks with their validity; 10.3 before."""
    data = pixels(BANDS, ROWS, COLUMNS, "uint16")
    path = written(tmp_path / "a.tif", data, nodata=7, tiled=True, blockxsize=BLOCK, blockysize=BLOCK)
    moved = pixel_map(lambda place: place + np.array([0.3, 0.4]), (COLUMNS, ROWS), (COLUMNS, ROWS))
    with opened_image(path) as source:
        # Compiled before, as that needs memory of its own.
        undistort_image(source, moved, tmp_path / "b.tif", Work(strip_bytes=1), lambda _: None)
        tracemalloc.start()
        undistort_image(source, moved, tmp_path / "b.tif", Work(strip_bytes=1), lambda _: None)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert most < 7.0 * 2 * BANDS * BLOCK * COLUMNS


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
