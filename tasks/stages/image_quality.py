"""The examination of images as a stage; the work is done in `tasks.image_quality`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.files.json_text import JSON
from tasks.settings.image_quality import EarlierResults, ImageQualitySettings, MotionSettings, SensorSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table
from tasks.tables.schemas.image_quality import SMEAR_MOTION


@stored("image_quality")
def examine_images(folder: Path, *, settings: ImageQualitySettings) -> None:
    """Write edges, edge_means, edge_responses, noise_levels and smears.parquet.

    Raises
    ------
    InputError
        If an image cannot be read, or the images differ in kind.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.image_quality.measurement import examine

    examine(folder, settings)


@stored("sensor_quality")
def examine_sensor(folder: Path, *, settings: SensorSettings) -> None:
    """Write sensor_sheets, defect_pixels, defect_columns, photon_transfer and aperture.parquet.

    Raises
    ------
    InputError
        If an image cannot be read, images differ in kind, or a series determines nothing.
    """
    from tasks.image_quality import sensor

    sensor.examine_sensor(folder, settings)


@stored("drift")
def compare_dates(
    folder: Path, *, stages: tuple[Mapping[str, Artifact], ...], earlier: EarlierResults
) -> None:
    """Write edge_drift and quality_drift.parquet, and remarks on what has changed.

    Parameters
    ----------
    stages : outputs of the examinations of scenes and sensor, those there are.

    Raises
    ------
    InputError
        If the earlier results cannot be read, or have none of the bands or nothing to compare.
    """
    from tasks.image_quality.dates import write_drift

    tables = {name: read_table(one) for outputs in stages for name, one in outputs.items() if name != "notes"}
    assert earlier.manifest is not None  # compared only where there is one
    write_drift(folder, tables, earlier.manifest.parent)


@stored("smear_motion")
def compare_with_motion(
    folder: Path, *, edges: Artifact, exposures: Artifact, cameras: Artifact, settings: MotionSettings
) -> None:
    """Write smear_motion.parquet, and remarks on images that contradict the movement of the camera.

    Raises
    ------
    InputError
        If an image has no exposure, or its exposure has no rates.
    """
    from tasks.evaluation.smear_by_motion import smear_motion_remarks, smear_motion_table
    from tasks.tables.parquet import of_schema, write_stage_table

    found = smear_motion_table(read_table(edges), read_table(exposures), read_table(cameras), settings)
    write_stage_table(folder, SMEAR_MOTION, of_schema(found, SMEAR_MOTION))
    contradicting = int(found["contradicts"].sum())
    figures: dict[str, JSON] = {"smear_motion": {"compared": len(found), "contradicting": contradicting}}
    write_notes(folder, Notes(tuple(smear_motion_remarks(found)), figures))
