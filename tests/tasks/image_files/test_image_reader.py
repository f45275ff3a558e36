"""Windows of images are the pixels that were written, with their mask; what is no image is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.image_files.image_reader import opened_image
from tests.tasks.image_files.images import pixels, written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")


@pytest.mark.parametrize("dtype", TYPES)
def test_a_window_has_the_pixels_that_were_written(dtype: str, tmp_path: Path) -> None:
    data = pixels(3, 50, 40, dtype)
    with opened_image(written(tmp_path / "a.tif", data)) as image:
        assert (image.description.columns, image.description.rows, image.description.bands) == (40, 50, 3)
        assert image.description.dtype == dtype
        np.testing.assert_array_equal(image.read((7, 21), (3, 33)), data[:, 7:21, 3:33])
        np.testing.assert_array_equal(image.read((0, 50)), data)
        assert image.valid((0, 50)) is None


def test_a_mask_holds_for_all_bands_and_a_value_for_each(tmp_path: Path) -> None:
    data = pixels(3, 50, 40, "uint8")
    with opened_image(written(tmp_path / "a.tif", data, nodata=7)) as image:
        assert image.description.validity == "nodata"
        np.testing.assert_array_equal(image.valid((5, 50)), data[:, 5:] != 7)
    mask = data[0] > 60
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.nodata = None
        file.write_mask(mask)
    with opened_image(tmp_path / "a.tif") as image:
        assert image.description.validity == "mask"
        np.testing.assert_array_equal(image.valid((0, 50)), mask[None])


def test_an_alpha_band_says_what_is_valid(tmp_path: Path) -> None:
    data = pixels(4, 50, 40, "uint8")
    data[3] = np.where(data[3] > 60, 255, 0)
    path = written(tmp_path / "a.tif", data, photometric="rgb", alpha="non-premultiplied")
    with opened_image(path) as image:
        assert (image.description.validity, image.description.alpha) == ("alpha", (3,))
        np.testing.assert_array_equal(image.valid((0, 50)), data[3:] == 255)


def test_fewer_bits_than_the_type_has_are_known(tmp_path: Path) -> None:
    with opened_image(written(tmp_path / "a.tif", pixels(1, 5, 4, "uint16"), nbits=12)) as image:
        assert (image.description.bits, image.description.largest) == (12, 4095.0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"", "image cannot be read"),
        (b"II*\0\x08\0\0\0", "image cannot be read"),
        (b"x" * 99, "image cannot be read"),
    ],
)
def test_what_is_no_image_is_refused(content: bytes | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=words), opened_image(path):
        pass


def test_a_file_that_names_other_files_is_refused(tmp_path: Path) -> None:
    written(tmp_path / "a.tif", pixels(1, 5, 4, "uint8"))
    path = tmp_path / "b.tif"
    path.write_text(
        '<VRTDataset rasterXSize="4" rasterYSize="5"><VRTRasterBand dataType="Byte" band="1"><SimpleSource>'
        f"<SourceFilename>{tmp_path / 'a.tif'}</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    with pytest.raises(InputError, match="image cannot be read"), opened_image(path):
        pass


def test_a_file_that_was_cut_off_is_named_with_its_rows(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", pixels(1, 500, 400, "uint8"), compress="deflate")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"a\.tif"), opened_image(path) as image:
        image.read((0, 500))


@pytest.mark.parametrize(("dtype", "words"), [("complex64", "complex64"), ("uint64", "uint64")])
def test_pixels_that_cannot_be_interpolated_are_refused(dtype: str, words: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", pixels(1, 5, 4, dtype))
    with pytest.raises(InputError, match=words), opened_image(path):
        pass


def test_colours_of_a_palette_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.tif", pixels(1, 5, 4, "uint8"), photometric="palette")
    with rasterio.open(path, "r+") as file:
        file.write_colormap(1, {0: (255, 0, 0, 255), 1: (0, 255, 0, 255)})
    with pytest.raises(InputError, match="palette"), opened_image(path):
        pass


def test_an_installation_without_the_extra_says_which_one_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "a.tif", pixels(1, 5, 4, "uint8"))
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InstallationError, match=r"pip install 'aerocal\[images\]'"), opened_image(path):
        pass
