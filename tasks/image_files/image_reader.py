"""An image file: its size and kind, its pixels window by window, and which of them are valid.

Rows count downwards, columns to the right, both from 0; windows are half-open ranges of them. Only formats
whose files hold their own pixels are opened: none that names other files or addresses.

rasterio, which reads and writes images by GDAL, is an extra of the installation, because its wheel has GEOS
(LGPL).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Bools
from tasks.errors import Location
from tasks.files.delivered_file import is_there
from tasks.files.installation import InstallationError

# What GDAL keeps of files it has read, MB; the rest of the memory is ours.
_CACHE_MB = 96
_ENDINGS = frozenset({".tif", ".tiff", ".jpg", ".jpeg", ".png", ".jp2"})


def raster_library() -> ModuleType:
    """The module rasterio.

    Raises
    ------
    InstallationError
        If the installation is without it.
    """
    try:
        import rasterio
        import rasterio.enums
        import rasterio.windows
    except ImportError as error:
        raise InstallationError(
            f"Images are read and written with rasterio, which cannot be loaded here ({error}).",
            "Install aerocal with its extra: pip install 'aerocal[images]'.",
        ) from error
    module: ModuleType = rasterio
    return module


@contextmanager
def raster_environment(threads: int = 1) -> Iterator[ModuleType]:
    """The module with a small cache, masks inside their files, and this many threads for (de)compression.

    Raises
    ------
    InstallationError
        As of `raster_library`.
    """
    rasterio = raster_library()
    options = {
        "GDAL_CACHEMAX": _CACHE_MB,
        "GDAL_NUM_THREADS": threads,
        "GDAL_TIFF_INTERNAL_MASK": True,
    }
    with warnings.catch_warnings():
        # An image as it was exposed lies nowhere on a map.
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.Env(**options):
            yield rasterio


#: GDAL's names of the formats that are opened.
DRIVERS = ("GTiff", "JPEG", "PNG", "JP2OpenJPEG")
Pixels: TypeAlias = NDArray[Any]
#: How a file says which pixels are valid: all are, by a value, by a mask, by an alpha band.
Validity: TypeAlias = Literal["all", "nodata", "mask", "alpha"]
_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")


@dataclass(frozen=True)
class ImageDescription:
    """Metadata of an image file.

    Attributes
    ----------
    path : of the file.
    columns, rows, bands : number of each.
    dtype : numpy's name of the type of the pixels.
    bits : of a pixel that are used; fewer than the type has where the file says so (12 of 16).
    validity : how it says which pixels are valid.
    nodata : value of pixels without data; None: there is none.
    alpha : numbers from 0 of the bands that are alpha.
    block_rows, block_columns : of one block of the file, which is decoded as a whole.
    """

    path: Path
    columns: int
    rows: int
    bands: int
    dtype: str
    bits: int
    validity: Validity
    nodata: float | None
    alpha: tuple[int, ...]
    block_rows: int
    block_columns: int

    @property
    def largest(self) -> float:
        """Largest value of a pixel: of its bits, or of its type."""
        if self.dtype.startswith("uint"):
            return float(2**self.bits - 1)
        kind = np.finfo(self.dtype) if self.dtype.startswith("float") else np.iinfo(self.dtype)
        return float(kind.max)


@dataclass(frozen=True, eq=False)
class ImageReader:
    """An open image.

    Attributes
    ----------
    description : what it says about itself.
    dataset : rasterio's, for what is not said here (tags, colours); of one thread at a time.
    """

    description: ImageDescription
    dataset: Any

    def read(
        self, rows: tuple[int, int], columns: tuple[int, int] | None = None, out: Pixels | None = None
    ) -> Pixels:
        """Pixels (bands, r, c) of a window; columns None: all; written to `out` if it is given.

        Raises
        ------
        InputError
            If the file is damaged there.
        """
        return np.asarray(self._of_file(self.dataset.read, rows, columns, out=out))

    def valid(self, rows: tuple[int, int], columns: tuple[int, int] | None = None) -> Bools | None:
        """Which pixels (1 or bands, r, c) of a window are valid; None: all are.

        One plane stands for all bands; by a value each band has its own.

        Raises
        ------
        InputError
            As of `read`.
        """
        if self.description.validity == "all":
            return None
        if self.description.validity == "nodata":
            return np.asarray(self._of_file(self.dataset.read_masks, rows, columns) != 0)
        # The same for all bands, and an alpha band is its own mask.
        return np.asarray(self._of_file(self.dataset.read_masks, rows, columns, indexes=[1]) != 0)

    def _of_file(
        self, read: Any, rows: tuple[int, int], columns: tuple[int, int] | None, **which: Any
    ) -> Any:
        import rasterio

        try:
            return read(window=(rows, columns or (0, self.description.columns)), **which)
        except rasterio.errors.RasterioError as error:
            raise Location(self.description.path).error(
                f"The image cannot be read in rows {rows[0]} to {rows[1] - 1} ({_reason(error)}).",
                "Deliver it again.",
            ) from error


@contextmanager
def opened_image(path: Path, threads: int = 1) -> Iterator[ImageReader]:
    """An image, open for reading.

    Parameters
    ----------
    threads : for decompression.

    Raises
    ------
    InputError
        If the file is not there, is not an image of `DRIVERS`, or has pixels that are no real numbers of up
        to 64 bits (complex ones, 64-bit integers, colours of a palette).
    InstallationError
        If rasterio is not installed.
    """
    if path.is_dir():
        raise Location(path).error("This is a folder, not an image.", _images_in(path))
    if not (is_there(path) and path.is_file()):
        raise Location(path).error("There is no such file.", "Check the path.")
    with raster_environment(threads) as rasterio:
        try:
            # Without links and in full, so that no name is taken for one of GDAL's virtual files.
            dataset = rasterio.DatasetReader(str(path.resolve()), driver=list(DRIVERS))
        except rasterio.errors.RasterioError as error:
            raise Location(path).error(
                f"This image cannot be read ({_reason(error)}).", "Deliver TIFF, JPEG, PNG or JPEG 2000."
            ) from error
        with dataset:
            yield ImageReader(_description(path, dataset), dataset)


def _images_in(folder: Path) -> str:
    """How to name the images in a folder."""
    endings = sorted({file.suffix for file in folder.glob("*") if file.suffix.lower() in _ENDINGS})
    if not endings:
        return "There is no image in it (TIFF, JPEG, PNG or JPEG 2000): check the path."
    return f"Name its images: {' '.join(f'{folder}/*{ending}' for ending in endings)}."


def described(path: Path) -> ImageDescription:
    """Metadata of an image file; raises the errors of `opened_image`."""
    with opened_image(path) as image:
        return image.description


def _description(path: Path, dataset: Any) -> ImageDescription:
    import rasterio

    types = set(dataset.dtypes)
    palette = rasterio.enums.ColorInterp.palette in dataset.colorinterp
    if len(types) != 1 or not types <= set(_TYPES) or palette:
        what = "colours of a palette" if palette else f"pixels of the type {', '.join(sorted(types))}"
        raise Location(path).error(
            f"The image has {what}, which cannot be interpolated.",
            "Deliver it with integers of up to 32 bits or with floating point.",
        )
    (dtype,) = types
    nodata = dataset.nodata if _can_hold(dtype, dataset.nodata) else None
    validity = _validity(dataset)
    said = dataset.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", "")
    alpha = rasterio.enums.ColorInterp.alpha
    return ImageDescription(
        path,
        dataset.width,
        dataset.height,
        dataset.count,
        dtype,
        int(said) if said.isdecimal() else 8 * np.dtype(dtype).itemsize,
        "all" if validity == "nodata" and nodata is None else validity,
        nodata,
        tuple(k for k, colour in enumerate(dataset.colorinterp) if colour == alpha),
        *dataset.block_shapes[0],
    )


def _can_hold(dtype: str, nodata: float | None) -> bool:
    """Whether there can be pixels of this value."""
    if nodata is None or dtype.startswith("float"):
        return nodata is not None
    limits = np.iinfo(dtype)
    return bool(limits.min <= nodata <= limits.max and nodata == np.floor(nodata))


def _validity(dataset: Any) -> Validity:
    import rasterio

    flags, kinds = set(dataset.mask_flag_enums[0]), rasterio.enums.MaskFlags
    if kinds.alpha in flags:
        return "alpha"
    if kinds.nodata in flags:
        return "nodata"
    return "mask" if kinds.per_dataset in flags else "all"


def _reason(error: Exception) -> str:
    """GDAL's message, which is the cause of rasterio's own error."""
    return str(error.__cause__ or error).rstrip(".")
