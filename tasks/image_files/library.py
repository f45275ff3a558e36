"""rasterio, which reads and writes images by GDAL; an extra of the installation, because its wheel has GEOS (LGPL)."""  # noqa: E501

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from tasks.files.installation import InstallationError

# What GDAL keeps of files it has read, MB; the rest of the memory is ours.
_CACHE_MB = 96


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
