"""Cloud-optimized GeoTIFF: directories first, overviews next, tiles last, put into this order by GDAL's own driver.

The order can be given only when everything is known, so the image is written as a plain TIFF first, without a
lossy compression, and copied block by block.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tasks.image_files.image_reader import ImageReader

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
