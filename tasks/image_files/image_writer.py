"""A TIFF like another image: its kind of pixels, blocks, compression, colours, mask and metadata, with other pixels.

It is written under a temporary name and is there at once or not at all. Rows are written from top to bottom, and the
mask after all of them, so that the bytes of the file do not depend on how many are written at a time.

Cloud-optimized GeoTIFF: directories first, overviews next, tiles last, put into this order by GDAL's own driver.

The order can be given only when everything is known, so the image is written as a plain TIFF first, without a
lossy compression, and copied block by block.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Bools
from tasks.errors import InputError
from tasks.files.installation import InstallationError, part_of, writing_into
from tasks.image_files.associated_alpha import has_associated_alpha
from tasks.image_files.image_reader import ImageDescription, ImageReader, Pixels, opened_image

#: First row and last + 1, and columns.
Window: TypeAlias = tuple[tuple[int, int], tuple[int, int]]
# Higher strips are not written: a whole one is in memory, bytes.
_HIGHEST_STRIP = 16_000_000
# Compressions that change no pixel; JPEG is kept with its quality, everything else is deflated.
_LOSSLESS = ("lzw", "deflate", "packbits", "zstd", "lzma")
# What describes a file or pixels that there are no more, or is written in another way.
_NOT_COPIED = ("IMAGE_STRUCTURE", "DERIVED_SUBDATASETS", "RPC", "GEOLOCATION", "COLOR_PROFILE", "xml:XMP")
_STATISTICS = "STATISTICS_"


@dataclass(frozen=True, eq=False)
class ImageWriter:
    """An image that is being written.

    Attributes
    ----------
    block_rows, block_columns : of a block of the file; multiples of them are written at a time.
    dataset : rasterio's.
    masks : parts of the mask that are still to be written: their windows, and 8 pixels in a byte.
    """

    block_rows: int
    block_columns: int
    dataset: Any
    masks: list[tuple[Window, NDArray[np.uint8]]] = field(default_factory=list)

    @property
    def is_by_bands(self) -> bool:
        """Whether the file has one band after the other; it gets them in turn, row of blocks by row."""
        said = self.dataset.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE")
        return bool(self.dataset.count > 1 and said == "BAND")

    def write(
        self, first: tuple[int, int], pixels: Pixels, valid: Bools | None, bands: slice | None = None
    ) -> None:
        """Write pixels (bands, r, c).

        Parameters
        ----------
        first : row and column of their first.
        valid : (1, r, c) goes into the mask; None: there is none.
        bands : numbers from 0; None: all.
        """
        indexes = self.dataset.indexes[bands or slice(None)]
        step = self.block_rows if self.is_by_bands else pixels.shape[1]
        for row in range(0, pixels.shape[1], step):
            some = pixels[:, row : row + step]
            self.dataset.write(some, indexes, window=_window((first[0] + row, first[1]), some))
        if valid is not None:
            self.masks.append((_window(first, valid), np.packbits(valid[0], axis=1)))


def _window(first: tuple[int, int], pixels: Pixels) -> Window:
    (row, column), (_, rows, columns) = first, pixels.shape
    return (row, row + rows), (column, column + columns)


@contextmanager
def image_like(source: ImageReader, path: Path, threads: int = 1) -> Iterator[ImageWriter]:
    """A TIFF of the size and kind of an open image; removed after an error.

    Parameters
    ----------
    threads : for compression.

    Raises
    ------
    InstallationError
        If the file cannot be written as a whole.
    """
    import rasterio

    part = part_of(path)
    options = _options(source)
    try:
        with writing_into(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            part.unlink(missing_ok=True)
            part.touch()
        try:
            with rasterio.open(part, "w", **options, num_threads=threads) as dataset:
                _describe(dataset, source.dataset)
                rows, columns = dataset.block_shapes[0]
                written = ImageWriter(rows, columns, dataset)
                yield written
            overviews = source.dataset.overviews(1)
            if written.masks or overviews:
                with rasterio.open(part, "r+") as dataset:
                    _add_mask(dataset, written)
                    if overviews:
                        dataset.build_overviews(overviews, rasterio.enums.Resampling.average)
            if is_cloud_optimized(source):
                said = source.dataset.tags(ns="IMAGE_STRUCTURE")
                make_cloud_optimized(part, source, _compression(source.dataset, said), threads)
            _require_whole(part, path)
        except rasterio.errors.RasterioError as error:
            raise _unwritable(path, error) from error
        with writing_into(path.parent):
            part.replace(path)
    finally:
        for left in (part, part.with_name(f"{part.name}.aux.xml"), reordered(part)):
            left.unlink(missing_ok=True)


def left_out_of(source: ImageReader) -> tuple[str, ...]:
    """Georeferencing of an open image by its pixels, which does not apply to other pixels."""
    points, _ = source.dataset.gcps
    found = (("ground control points", points), ("rational polynomials", source.dataset.rpcs))
    return tuple(name for name, there in found if there)


def _options(source: ImageReader) -> dict[str, Any]:
    """Options that create a file like the source."""
    dataset, about = source.dataset, source.description
    said = dataset.tags(ns="IMAGE_STRUCTURE")
    options = {
        "driver": "GTiff",
        "width": about.columns,
        "height": about.rows,
        "count": about.bands,
        "dtype": about.dtype,
        "nodata": about.nodata,
        "interleave": said.get("INTERLEAVE", "PIXEL").lower() if about.bands > 1 else "pixel",
        "photometric": _photometric(dataset, said),
        "bigtiff": "if_safer",
        **_blocks(about, dataset),
        **(NOT_YET if is_cloud_optimized(source) else _compression(dataset, said)),
    }
    if is_cloud_optimized(source) and options["photometric"] == "ycbcr":
        options["photometric"] = "rgb"  # JPEG makes it YCbCr again
    if not dataset.transform.is_identity or dataset.crs is not None:
        options |= {"crs": dataset.crs, "transform": dataset.transform}
    if about.alpha:
        options["alpha"] = "premultiplied" if has_associated_alpha(about.path) else "yes"
    if about.bits < 8 * np.dtype(about.dtype).itemsize:
        options["nbits"] = about.bits
    profile = dataset.tags(ns="COLOR_PROFILE").get("SOURCE_ICC_PROFILE")
    if profile:
        options["source_icc_profile"] = profile
    return options


def _blocks(about: ImageDescription, dataset: Any) -> dict[str, Any]:
    """Tiles or strips of the same size; those of other formats than TIFF become tiles."""
    if dataset.driver != "GTiff":
        return {"tiled": True, "blockxsize": 512, "blockysize": 512}
    rows, columns = dataset.block_shapes[0]
    # A strip is as wide as the image.
    if columns != about.columns:
        return {"tiled": True, "blockxsize": columns, "blockysize": rows}
    size = about.bands * rows * columns * np.dtype(about.dtype).itemsize
    return {"blockysize": rows} if size <= _HIGHEST_STRIP else {}


def _compression(dataset: Any, said: dict[str, str]) -> dict[str, Any]:
    """The same compression, if TIFF has it and it is lossless or JPEG."""
    name = "" if dataset.compression is None else dataset.compression.value.lower()
    if dataset.driver == "GTiff":
        if not name:
            return {}
        if name in _LOSSLESS:
            return {"compress": name, "predictor": said.get("PREDICTOR", "1")}
        if name == "jpeg":
            return {"compress": "jpeg", "jpeg_quality": said.get("JPEG_QUALITY", "95")}
    whole = np.issubdtype(np.dtype(dataset.dtypes[0]), np.integer)
    return {"compress": "deflate", "predictor": 2 if whole else 3}


def _photometric(dataset: Any, said: dict[str, str]) -> str:
    from rasterio.enums import ColorInterp

    if dataset.count == 4 and "SOURCE_COLOR_SPACE" in said:
        return "rgb"  # GDAL has made red, green, blue and alpha of other colours
    if dataset.driver == "GTiff" and dataset.photometric is not None:
        return str(dataset.photometric.value).lower().replace(" ", "")
    if said.get("MINISWHITE") == "YES":
        return "miniswhite"
    colours = dataset.colorinterp[:3]
    return "rgb" if colours == (ColorInterp.red, ColorInterp.green, ColorInterp.blue) else "minisblack"


def _describe(dataset: Any, source: Any) -> None:
    """Copy colours, names, units and metadata."""
    dataset.colorinterp = source.colorinterp
    dataset.descriptions = source.descriptions
    for name in ("units", "scales", "offsets"):
        if len(set(getattr(source, name))) > 1 or getattr(source, name) != getattr(dataset, name):
            setattr(dataset, name, getattr(source, name))
    _copy_tags(dataset, source)
    for namespace in set(source.tag_namespaces()) - set(_NOT_COPIED):
        _copy_tags(dataset, source, ns=namespace)
    for band in source.indexes:
        _copy_tags(dataset, source, bidx=band)
    packet = source.tags(ns="xml:XMP").get("xml:XMP", "")
    # What is stored is the key, =, and the value; of XML it must be the text alone.
    before, _, after = packet.partition("=")
    if after:
        dataset.update_tags(ns="xml:XMP", **{before: after})


def _copy_tags(dataset: Any, source: Any, **of: Any) -> None:
    tags = source.tags(**of).items()
    kept = {name: text for name, text in tags if not name.startswith(_STATISTICS)}
    if kept:
        bidx = of.get("bidx", 0)
        dataset.update_tags(bidx, of.get("ns"), **kept)


def _add_mask(dataset: Any, written: ImageWriter) -> None:
    for window, packed in written.masks:
        first, end = window[1]
        valid = np.unpackbits(packed, axis=1, count=end - first).astype(np.bool_)
        dataset.write_mask(valid, window=window)


def _require_whole(part: Path, path: Path) -> None:
    """Refuse a file whose end is missing: GDAL does not report a full disk when it closes a file."""
    try:
        with opened_image(part) as written:
            rows = written.description.rows
            written.read((rows - 1, rows))
    except InputError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: Exception) -> InstallationError:
    reason = str(error.__cause__ or error).rstrip(".")
    return InstallationError(
        f"{path} cannot be written ({reason}).",
        "Free some space or choose another folder with --out, then run again; nothing half-written was kept.",
    )


#: Compression until the order is given: it changes no pixel.
NOT_YET: Mapping[str, Any] = {"compress": "deflate", "zlevel": 1}
# The driver takes square tiles of a multiple of 16 from this size on.
_LEAST_TILE = 128


def is_cloud_optimized(source: ImageReader) -> bool:
    """Whether GDAL regards an open image as a cloud-optimized GeoTIFF unchanged since it was written."""
    dataset = source.dataset
    return bool(dataset.driver == "GTiff" and dataset.tags(ns="IMAGE_STRUCTURE").get("LAYOUT") == "COG")


def reordered(part: Path) -> Path:
    """The name of the copy while it is written."""
    return part.with_name(f"{part.name}.cog")


def make_cloud_optimized(
    part: Path, source: ImageReader, compression: Mapping[str, Any], threads: int
) -> None:
    """Replace a plain TIFF by a cloud-optimized one with its own overviews and mask.

    Parameters
    ----------
    compression : creation options of a plain TIFF.
    """
    import rasterio.shutil

    rows, columns = source.dataset.block_shapes[0]
    options: dict[str, Any] = {
        "compress": compression.get("compress", "none"),
        "overviews": "FORCE_USE_EXISTING",
        "bigtiff": "IF_SAFER",
        "num_threads": threads,
    }
    if "predictor" in compression:
        options["predictor"] = {"1": "NO", "2": "STANDARD", "3": "FLOATING_POINT"}[
            str(compression["predictor"])
        ]
    if "jpeg_quality" in compression:
        options["quality"] = options["overview_quality"] = compression["jpeg_quality"]
    if rows == columns and rows >= _LEAST_TILE and rows % 16 == 0:
        options["blocksize"] = rows
    if source.description.bits < 8 and source.description.dtype == "uint8":
        options["nbits"] = source.description.bits
    rasterio.shutil.copy(part, reordered(part), driver="COG", **options)
    reordered(part).replace(part)
