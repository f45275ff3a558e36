"""An image written like another one is that, but for its pixels; what cannot be written leaves nothing."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rasterio.enums import ColorInterp

from tasks.files.installation import InstallationError
from tasks.image_files.image_reader import ImageReader, opened_image
from tasks.image_files.image_writer import image_like, left_out_of
from tests.tasks.forked import FORK, in_processes
from tests.tasks.image_files.images import pixels, written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
ROWS, COLUMNS = 530, 410
XMP = '<?xpacket begin="" id="W5M0"?><x:xmpmeta xmlns:x="adobe:ns:meta/"/><?xpacket end="w"?>'
CASES = {
    "strips": {},
    "strips of 7 rows": {"blockysize": 7, "compress": "lzw"},
    "tiles": {"tiled": True, "blockxsize": 128, "blockysize": 256},
    "deflated": {"tiled": True, "blockxsize": 128, "blockysize": 128, "compress": "deflate", "predictor": 2},
    "zstd by bands": {"compress": "zstd", "interleave": "band"},
    "white is 0": {"photometric": "miniswhite", "bands": 1},
    "12 bits": {"nbits": 12, "dtype": "uint16", "compress": "deflate"},
    "colours": {"photometric": "rgb", "dtype": "uint16"},
    "colours and infrared": {"photometric": "rgb", "bands": 4, "dtype": "uint16"},
    "alpha": {"photometric": "rgb", "bands": 4, "alpha": "non-premultiplied"},
    "no data": {"nodata": 7},
    "floating point": {"dtype": "float32", "nodata": np.nan, "compress": "deflate", "predictor": 3},
    "on a map": {"crs": "EPSG:2154", "transform": rasterio.Affine(0.1, 0, 650_000, 0, -0.1, 6_860_000)},
    "big": {"bigtiff": "yes"},
}


def copied(
    source: Path, path: Path, rows: int = 256, check: Callable[[ImageReader], None] | None = None
) -> Path:
    with opened_image(source) as image:
        if check is not None:
            check(image)
        with image_like(image, path) as made:
            step = max(rows // made.block_rows, 1) * made.block_rows
            for first in range(0, image.description.rows, step):
                window = (first, min(first + step, image.description.rows))
                valid = image.valid(window) if image.description.validity == "mask" else None
                made.write((first, 0), image.read(window), valid)
    return path


def facts(path: Path) -> dict[str, object]:
    """Everything GDAL says about an image."""
    with rasterio.open(path) as file:
        namespaces = sorted(set(file.tag_namespaces()) - {"DERIVED_SUBDATASETS"})
        return {
            "profile": str(file.profile), "tags": file.tags(), "bands": [file.tags(k) for k in file.indexes],
            "more": {name: file.tags(ns=name) for name in namespaces}, "colours": file.colorinterp,
            "descriptions": file.descriptions, "units": file.units, "scales": file.scales,
            "offsets": file.offsets, "masks": file.mask_flag_enums, "overviews": file.overviews(1),
            "pixels": file.read().tobytes(), "valid": file.read_masks().tobytes(),
        }  # fmt: skip


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
@pytest.mark.parametrize("case", CASES)
def test_a_copy_is_the_same_to_gdal(case: str, tmp_path: Path) -> None:
    options = dict(CASES[case])
    data = pixels(int(options.pop("bands", 3)), ROWS, COLUMNS, str(options.pop("dtype", "uint8")))
    source = written(tmp_path / "a.tif", data, **options)
    assert facts(copied(source, tmp_path / "copy" / "a.tif")) == facts(source)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_metadata_names_masks_and_overviews_are_kept_and_statistics_are_not(tmp_path: Path) -> None:
    source = written(tmp_path / "a.tif", pixels(3, ROWS, COLUMNS, "uint16"), photometric="rgb", tiled=True)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(source, "r+") as file:
        file.write_mask(pixels(1, ROWS, COLUMNS, "uint8")[0] > 40)
        file.build_overviews([2, 4])
        file.update_tags(TIFFTAG_DATETIME="2026:05:24 10:11:12", TIFFTAG_SOFTWARE="UltraMap", FLIGHT="ä 7")
        file.update_tags(ns="EXIF", EXIF_Make="Vexcel")
        file.update_tags(ns="OWN", line="12")
        file.update_tags(2, wavelength="550 nm", STATISTICS_MEAN="3.5")
        file.update_tags(ns="xml:XMP", **dict([XMP.split("=", 1)]))
        file.descriptions, file.units = ("R", "G", "B"), ("DN", "DN", "DN")
        file.scales, file.offsets = (0.5, 0.5, 0.5), (1.0, 0.0, 2.0)
    expected, made = facts(source), facts(copied(source, tmp_path / "b.tif"))
    expected["bands"][1].pop("STATISTICS_MEAN")
    for name in ("pixels", "valid"):
        assert expected.pop(name) == made.pop(name)
    assert made == expected
    assert XMP in made["more"]["xml:XMP"]["xml:XMP"]
    assert made["overviews"] == [2, 4]


@pytest.mark.parametrize("case", ["deflated", "strips of 7 rows", "zstd by bands", "alpha"])
@pytest.mark.parametrize("masked", [False, True])
def test_bytes_do_not_depend_on_the_rows_at_a_time(case: str, masked: bool, tmp_path: Path) -> None:
    options = dict(CASES[case])
    source = written(
        tmp_path / "a.tif", pixels(int(options.pop("bands", 3)), ROWS, COLUMNS, "uint8"), **options
    )
    if masked and case != "alpha":
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(source, "r+") as file:
            file.write_mask(pixels(1, ROWS, COLUMNS, "uint8")[0] > 40)
    assert len({copied(source, tmp_path / "b.tif", rows).read_bytes() for rows in (1, 300, 600)}) == 1


def test_jpeg_stays_jpeg_in_its_quality_and_other_formats_lose_nothing(tmp_path: Path) -> None:
    data = pixels(3, ROWS, COLUMNS, "uint8")
    lossy = written(tmp_path / "a.tif", data, compress="jpeg", jpeg_quality=91, photometric="ycbcr")
    with rasterio.open(copied(lossy, tmp_path / "b.tif")) as file:
        assert file.tags(ns="IMAGE_STRUCTURE")["JPEG_QUALITY"] == "91"
        assert file.photometric.value == "YCbCr"
    for driver, ending in (("JPEG", "jpg"), ("PNG", "png")):
        source = written(tmp_path / f"a.{ending}", data, driver=driver)
        with rasterio.open(source) as given, rasterio.open(copied(source, tmp_path / "c.tif")) as file:
            np.testing.assert_array_equal(file.read(), given.read())
            assert file.compression.value == "DEFLATE"
            assert file.colorinterp == (ColorInterp.red, ColorInterp.green, ColorInterp.blue)


@pytest.mark.parametrize(("photometric", "bands"), [("cmyk", 4), ("cielab", 3)])
def test_colours_that_gdal_converts_are_written_as_converted(
    photometric: str, bands: int, tmp_path: Path
) -> None:
    source = written(tmp_path / "a.tif", pixels(bands, ROWS, COLUMNS, "uint8"), photometric=photometric)
    with rasterio.open(source) as given, rasterio.open(copied(source, tmp_path / "b.tif")) as file:
        np.testing.assert_array_equal(file.read(), given.read())
        assert file.colorinterp == given.colorinterp


def cog(path: Path, data: np.ndarray, **options: object) -> Path:
    """A cloud-optimized GeoTIFF with overviews."""
    plain = written(path.with_name("plain.tif"), data, **({"photometric": "rgb"} if len(data) == 3 else {}))
    with rasterio.open(plain, "r+") as file:
        file.build_overviews([2, 4])
    rasterio.shutil.copy(plain, path, driver="COG", blocksize=128, overviews="FORCE_USE_EXISTING", **options)
    return path


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize(
    ("dtype", "options", "bands"),
    [
        ("uint8", {"compress": "deflate", "predictor": "STANDARD"}, 3),
        ("uint16", {"compress": "zstd"}, 1),
        ("float32", {"compress": "none"}, 1),
        pytest.param("uint8", {"compress": "deflate"}, 1, marks=pytest.mark.slow),
        pytest.param("uint16", {"compress": "zstd"}, 3, marks=pytest.mark.slow),
        pytest.param("float32", {"compress": "none"}, 3, marks=pytest.mark.slow),
    ],
)
def test_a_cloud_optimized_image_stays_one(
    dtype: str, options: dict[str, str], bands: int, tmp_path: Path
) -> None:
    source = cog(tmp_path / "a.tif", pixels(bands, ROWS, COLUMNS, dtype), **options)
    expected = facts(source)
    assert expected["more"]["IMAGE_STRUCTURE"]["LAYOUT"] == "COG"  # type: ignore[index]
    assert expected["overviews"] == [2, 4]
    copies = [copied(source, tmp_path / f"copy{rows}" / "a.tif", rows) for rows in (128, 640)]
    assert facts(copies[0]) == expected
    assert copies[0].read_bytes() == copies[1].read_bytes()
    assert [path.name for path in copies[0].parent.iterdir()] == ["a.tif"]


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_cloud_optimized_jpeg_is_compressed_once_and_keeps_its_quality_and_mask(tmp_path: Path) -> None:
    plain = written(tmp_path / "plain.tif", pixels(3, ROWS, COLUMNS, "uint8"), photometric="rgb")
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(plain, "r+") as file:
        file.write_mask(pixels(1, ROWS, COLUMNS, "uint8")[0] > 40)
        file.build_overviews([2])
    source = tmp_path / "a.tif"
    rasterio.shutil.copy(plain, source, driver="COG", compress="jpeg", quality=83, blocksize=256)
    with rasterio.open(copied(source, tmp_path / "b.tif")) as made, rasterio.open(source) as given:
        assert made.tags(ns="IMAGE_STRUCTURE") == given.tags(ns="IMAGE_STRUCTURE")
        assert made.photometric == given.photometric
        np.testing.assert_array_equal(made.read_masks(1), given.read_masks(1))


def test_a_place_that_holds_for_the_pixels_is_left_out_and_named(tmp_path: Path) -> None:
    source = written(tmp_path / "a.tif", pixels(1, 20, 30, "uint8"))
    points = [
        rasterio.control.GroundControlPoint(r, c, 5.0 + c, 6.0 - r) for r, c in ((0, 0), (0, 9), (9, 0))
    ]
    with rasterio.open(source, "r+") as file:
        file.gcps = (points, rasterio.crs.CRS.from_epsg(4326))
    named = []
    path = copied(source, tmp_path / "b.tif", check=lambda image: named.extend(left_out_of(image)))
    assert named == ["ground control points"]
    with rasterio.open(path) as file:
        assert not file.gcps[0]


def test_two_processes_write_the_same_image_at_the_same_time(tmp_path: Path) -> None:
    """Each as a file of its own; one was taken away from the other."""
    source, path = written(tmp_path / "a.tif", pixels(1, 200, 300, "uint8")), tmp_path / "b.tif"
    together = FORK.Barrier(2)

    def work(_index: int) -> str:
        with opened_image(source) as image, image_like(image, path) as made:
            together.wait(30)
            made.write((0, 0), image.read((0, 200)), None)
            together.wait(30)
        return "written"

    assert in_processes(2, work) == ["written", "written"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.tif", "b.tif"]
    with rasterio.open(path) as file:
        np.testing.assert_array_equal(file.read(), pixels(1, 200, 300, "uint8"))


def broken_off(source: Path, path: Path) -> None:
    with opened_image(source) as image, image_like(image, path) as made:
        made.write((0, 0), image.read((0, 100)), None)
        raise ZeroDivisionError


@pytest.mark.parametrize("before", [[], ["b.tif"]])
def test_after_an_error_there_is_the_file_of_before_or_none(before: list[str], tmp_path: Path) -> None:
    source = written(tmp_path / "a.tif", pixels(1, 200, 300, "uint8"))
    for name in before:
        (tmp_path / name).write_bytes(b"of before")
    with pytest.raises(ZeroDivisionError):
        broken_off(source, tmp_path / "b.tif")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.tif", *before]
    assert all((tmp_path / name).read_bytes() == b"of before" for name in before)


@pytest.mark.parametrize("compress", [None, "deflate"])
def test_a_full_disk_is_named_and_leaves_nothing(compress: str | None, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    data = rng.integers(0, 255, (1, 1000, 3000)).astype(np.uint8)
    source = written(tmp_path / "a.tif", data, compress=compress)
    process = multiprocessing.get_context("fork").Process(
        target=no_more_than, args=(source, tmp_path / "b.tif")
    )
    process.start()
    process.join()
    assert process.exitcode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.tif"]


def no_more_than(source: Path, path: Path, most: int = 1_000_000) -> None:
    """Copy with files that cannot be larger than this, as on a full disk; for a process of its own."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    with pytest.raises(InstallationError, match=f"{path.name} cannot be written"):
        copied(source, path)
    # Without what the process that was copied would do at its end (a worker of pytest-xdist fails there).
    os._exit(0)


@pytest.mark.parametrize("driver", ["GTiff", "COG"])
def test_an_image_may_have_the_longest_name_there_is(tmp_path: Path, driver: str) -> None:
    path = tmp_path / f"{'x' * 251}.tif"
    plain = written(tmp_path / "plain.tif", pixels(1, ROWS, COLUMNS, "uint8"))
    rasterio.shutil.copy(plain, tmp_path / "a.tif", driver=driver)
    with opened_image(tmp_path / "a.tif") as source:
        data = source.read((0, ROWS))
        with image_like(source, path) as made:
            made.write((0, 0), data, None)
    with rasterio.open(path) as found:
        np.testing.assert_array_equal(found.read(), data)
    assert {file.name for file in tmp_path.iterdir()} == {"plain.tif", "a.tif", path.name}
