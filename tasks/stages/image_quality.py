"""The examination of images as a stage; the work is done in `tasks.image_quality`."""

from __future__ import annotations

from pathlib import Path

from tasks.settings.image_quality import ImageQualitySettings
from tasks.store.store import stored


@stored("image_quality")
def examine_images(folder: Path, *, settings: ImageQualitySettings) -> None:
    """Write edges, edge_means, edge_responses and noise_levels.parquet.

    Raises
    ------
    InputError
        If an image cannot be read, or the images are not alike.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.image_quality.measurement import examine

    examine(folder, settings)
