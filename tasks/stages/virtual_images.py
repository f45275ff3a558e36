"""Exposures and image points of virtual images, composed with a calibrated platform."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from tasks.calibration.platform import adjusted_platforms
from tasks.calibration.virtual_block import virtual_block
from tasks.coordinates.crs import MapFrame
from tasks.errors import NotComputableError
from tasks.settings.project import ProjectSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import of_schema, read_table, write_stage_table
from tasks.tables.schemas.deliveries import CAMERAS, EXPOSURES, IMAGE_POINTS


@stored("virtual_images")
def compose_virtual_images(
    folder: Path,
    *,
    parameters: Artifact,
    correlations: Artifact,
    cameras: Artifact,
    images: Artifact,
    exposures: Artifact,
    image_points: Artifact,
    project: ProjectSettings,
) -> None:
    """Write cameras, exposures and image_points.parquet of the virtual images, and notes.

    Parameters
    ----------
    parameters, correlations, cameras, images, exposures, image_points : tables of the calibrated flight.

    Raises
    ------
    NotComputableError
        If the flight has not calibrated a platform, or its heads have additional parameters.
    """
    table, found = read_table(cameras), read_table(parameters)
    _refuse_additional(found, table)
    platform = next(adjusted_platforms(found, read_table(correlations), table, read_table(images)), None)
    if platform is None:
        raise NotComputableError(
            "There is no calibrated platform for the burn-in protocol. Estimate `relative_rotation` of heads "
            "whose reference head takes no pictures (calibration.free)."
        )
    block = virtual_block(platform, read_table(exposures), table, read_table(image_points))
    frame = MapFrame.of(project.crs, project.heights)
    own = table[table["camera"] == platform.name]
    write_stage_table(folder, CAMERAS, of_schema(own, CAMERAS))
    write_stage_table(folder, EXPOSURES, of_schema(block.exposures, EXPOSURES), frame)
    write_stage_table(folder, IMAGE_POINTS, of_schema(block.image_points, IMAGE_POINTS))
    sentence = (
        f"{len(block.exposures):,} virtual images with {len(block.image_points):,} image points were "
        f"composed for ground {platform.distance:,.0f} m below the platform; {block.doubled:,} image points "
        f"of a second head and {block.outside:,} outside the format were left out."
    )
    write_notes(folder, Notes((sentence,)))


def _refuse_additional(parameters: pd.DataFrame, cameras: pd.DataFrame) -> None:
    """Refuse heads with distortion: composition needs ideal image coordinates."""
    estimated = parameters["parameter"].str.contains(":", regex=False)
    if estimated.any() or (cameras["additional_parameters"] != "{}").any():
        raise NotComputableError(
            "The virtual images cannot be composed: heads have additional parameters, which the composition "
            "does not correct. Deliver image points that are corrected for them, or remove [burn_in]."
        )
