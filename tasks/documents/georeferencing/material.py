"""What the page of a check is made from: the tables of the check and its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import pandas as pd
from pydantic import BaseModel, ConfigDict

from tasks.results.summary import ParameterFigure, Summary, summary_of
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table

#: East, north, up; null where there is no point.
Triple: TypeAlias = tuple[float | None, float | None, float | None]
NONE: Triple = (None, None, None)


class _Figure(BaseModel):
    """Figures that a later version may have more of."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class DifferenceFigures(_Figure):
    """Differences at some points and their prediction, east, north, up; metres."""

    points: Triple = NONE
    rmse_m: Triple = NONE
    mean_m: Triple = NONE
    sd_m: Triple = NONE
    max_m: Triple = NONE
    rmse_gsd: Triple = NONE
    max_gsd: Triple = NONE
    predicted_rmse_m: Triple = NONE
    predicted_low_m: Triple = NONE
    predicted_high_m: Triple = NONE
    predicted_mean_sigma_m: Triple = NONE
    degrees_of_freedom: Triple = NONE
    predicted_parts_m: Mapping[str, Triple] = {}

    @property
    def count(self) -> int:
        """Number of points; the largest of the three."""
        return int(max((value or 0.0) for value in self.points))


class StatementFigure(_Figure):
    """What one standard says."""

    standard: str
    edition: str
    tested: bool
    check_points: int
    check_points_needed: int
    sentence: str


class CheckFigures(DifferenceFigures):
    """Figures of a check: the differences at independent points, at others, in models, and the parallaxes."""

    at_control_of_calibration: DifferenceFigures = DifferenceFigures()
    in_models: DifferenceFigures = DifferenceFigures()
    gsd_m: float | None = None
    statements: tuple[StatementFigure, ...] = ()
    calibration: tuple[ParameterFigure, ...] = ()
    y_parallaxes: int = 0
    y_parallax_models: int = 0
    y_parallax_mismatches: int = 0
    y_parallax_rms_um: float | None = None
    y_parallax_max_um: float | None = None
    y_parallax_predicted_rms_um: float | None = None
    y_parallax_predicted_low_um: float | None = None
    y_parallax_predicted_high_um: float | None = None
    y_parallax_predicted_max_um: float | None = None
    y_parallax_predicted_max_limit_um: float | None = None
    y_parallax_remaining_sigma_um: float | None = None
    y_parallax_image_sigma_um: float | None = None


@dataclass(frozen=True, eq=False)
class CheckMaterial:
    """The tables of one check, and its figures.

    Attributes
    ----------
    project : the settings of the run.
    summary : what summary.json says, without timings.
    figures : those of the check.
    images, exposures, points, parallaxes, models : images, exposures, direct_georeferencing, y_parallaxes and
        stereo_models.parquet.
    """

    project: Project
    summary: Summary
    figures: CheckFigures
    images: pd.DataFrame
    exposures: pd.DataFrame
    points: pd.DataFrame
    parallaxes: pd.DataFrame
    models: pd.DataFrame


def read_check(stages: Sequence[Mapping[str, Artifact]], project: Project) -> CheckMaterial:
    """Read everything the page shows.

    Parameters
    ----------
    stages : the outputs of all stages by name, in the order in which they ran.
    """
    tables = {name: artifact for outputs in stages for name, artifact in outputs.items()}
    notes = [read_notes(outputs["notes"]) for outputs in stages if "notes" in outputs]
    summary = summary_of(notes, project.gates, {})
    direct = summary.direct_georeferencing
    return CheckMaterial(
        project,
        summary,
        CheckFigures.model_validate({} if direct is None else direct.model_dump()),
        read_table(tables["images"]),
        read_table(tables["exposures"]),
        read_table(tables["direct_georeferencing"]),
        read_table(tables["y_parallaxes"]),
        read_table(tables["stereo_models"]),
    )
