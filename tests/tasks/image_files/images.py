"""Images of random pixels, written by rasterio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio


def pixels(bands: int, rows: int, columns: int, dtype: str) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 120, (bands, rows, columns)).astype(dtype)


def written(path: Path, data: np.ndarray, **options: object) -> Path:
    bands, rows, columns = data.shape
    with rasterio.open(
        path, "w", driver=options.pop("driver", "GTiff"), width=columns, height=rows, count=bands,
        dtype=data.dtype, **options,
    ) as file:  # fmt: skip
        file.write(data)
    return path
