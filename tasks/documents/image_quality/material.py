"""The material of the page about image quality."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import pandas as pd

from tasks.files.json_text import JSON
from tasks.settings.image_quality import ImageQualitySettings
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table


@dataclass(frozen=True, eq=False)
class SceneMaterial:
    """Tables and figures of scenes.

    Attributes
    ----------
    edges, means, responses, noise, smears : tables of these contents.
    figures : of the notes.
    """

    edges: pd.DataFrame
    means: pd.DataFrame
    responses: pd.DataFrame
    noise: pd.DataFrame
    smears: pd.DataFrame
    figures: Mapping[str, JSON]

    @property
    def whole(self) -> pd.DataFrame:
        """The means of all edges of each band."""
        return self.means[(self.means["direction"] == "all") & (self.means["zone"] == "all")]

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the images."""
        return int(cast(int, self.figures["columns"])), int(cast(int, self.figures["rows"]))


@dataclass(frozen=True, eq=False)
class SensorMaterial:
    """Tables and figures of a sensor.

    Attributes
    ----------
    sheets, pixels, columns, transfer, aperture : tables of these contents.
    figures : of the notes.
    """

    sheets: pd.DataFrame
    pixels: pd.DataFrame
    columns: pd.DataFrame
    transfer: pd.DataFrame
    aperture: pd.DataFrame
    figures: Mapping[str, JSON]


@dataclass(frozen=True, eq=False)
class QualityMaterial:
    """The examinations; None for one that was not made.

    Attributes
    ----------
    drift, changes : of the factors, and of other quantities, since an earlier date.
    motion : smear by the movement of the camera and by the edges.
    problems : remarks of all stages.
    settings : of the run.
    """

    scenes: SceneMaterial | None
    sensor: SensorMaterial | None
    drift: pd.DataFrame | None
    changes: pd.DataFrame | None
    motion: pd.DataFrame | None
    problems: tuple[str, ...]
    settings: ImageQualitySettings


def read_quality(stages: Sequence[Mapping[str, Artifact]], settings: ImageQualitySettings) -> QualityMaterial:
    """Read what the examinations wrote."""
    scenes = sensor = drift = changes = motion = None
    problems: tuple[str, ...] = ()
    for outputs in stages:
        notes = read_notes(outputs["notes"])
        problems = (*problems, *notes.problems)
        tables = {name: read_table(one) for name, one in outputs.items() if name != "notes"}
        if "edges" in outputs:
            figures = cast(Mapping[str, JSON], notes.figures["image_quality"])
            scenes = SceneMaterial(
                tables["edges"],
                tables["edge_means"],
                tables["edge_responses"],
                tables["noise_levels"],
                tables["smears"],
                figures,
            )
        elif "edge_drift" in outputs:
            drift, changes = tables["edge_drift"], tables["quality_drift"]
        elif "smear_motion" in outputs:
            motion = tables["smear_motion"]
        else:
            figures = cast(Mapping[str, JSON], notes.figures["sensor"])
            sensor = SensorMaterial(
                sheets=tables["sensor_sheets"],
                pixels=tables["defect_pixels"],
                columns=tables["defect_columns"],
                transfer=tables["photon_transfer"],
                aperture=tables["aperture"],
                figures=figures,
            )
    return QualityMaterial(scenes, sensor, drift, changes, motion, problems, settings)
