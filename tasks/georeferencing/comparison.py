"""Directly oriented images compared with surveyed points and with each other, and the tables of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Bools
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.local_frame import map_from_local
from tasks.georeferencing.calibration import Calibration
from tasks.georeferencing.directly_oriented import DirectlyOriented
from tasks.georeferencing.point_differences import (
    PointDifferences,
    SurveyedRays,
    multi_ray,
    point_differences,
    survey_of,
    two_rays,
)
from tasks.georeferencing.stereo_models import (
    ModelParallaxes,
    model_columns,
    model_parallaxes,
    model_rays,
    parallax_columns,
)
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.georeferencing import (
    DIRECT_GEOREFERENCING,
    DIRECT_GEOREFERENCING_MODELS,
    STEREO_MODELS,
    Y_PARALLAXES,
)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything a check examines.

    Attributes
    ----------
    oriented : the images and their points.
    surveyed : k surveyed points.
    independent : (k,) which of them had no part in the calibration.
    points : surveyed points intersected from all their rays.
    pairs, in_models : their pairs of rays in the stereo models, and the intersections of these.
    parallaxes : y-parallaxes of all models.
    """

    oriented: DirectlyOriented
    surveyed: SurveyedPoints
    independent: Bools
    points: PointDifferences
    pairs: SurveyedRays
    in_models: PointDifferences
    parallaxes: ModelParallaxes

    @property
    def not_intersected(self) -> list[str]:
        """Names of the surveyed points that could not be intersected."""
        return sorted(set(self.surveyed.name) - {self.surveyed.name[i] for i in self.points.surveyed})


def compared(
    oriented: DirectlyOriented, control_points: pd.DataFrame, calibration: Calibration, critical_value: float
) -> Comparison:
    """Compare with all surveyed points, and the images of every stereo model with each other.

    Parameters
    ----------
    control_points : control_points.parquet.
    critical_value : above which a y-parallax is taken for a mismatch.
    """
    surveyed = survey_of(oriented, control_points)
    models = model_rays(oriented)
    pairs = two_rays(oriented, surveyed, models)
    return Comparison(
        oriented,
        surveyed,
        _independent(oriented, surveyed, control_points, calibration),
        point_differences(oriented, surveyed, multi_ray(oriented, surveyed)),
        pairs,
        point_differences(oriented, surveyed, pairs),
        model_parallaxes(oriented, models, critical_value),
    )


def _independent(
    oriented: DirectlyOriented,
    surveyed: SurveyedPoints,
    control_points: pd.DataFrame,
    calibration: Calibration,
) -> Bools:
    """(k,) surveyed points that had no part in the calibration.

    Of values that are in the project's cameras nobody knows where they come from: the project's own
    control points are then not counted as independent.
    """
    if calibration.is_empty:
        return surveyed.is_check
    x_in_map = control_points[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    return ~calibration.control.contains(surveyed.name, x_in_map, oriented.map_frame.name)


def write_comparison(folder: Path, comparison: Comparison) -> None:
    """direct_georeferencing, direct_georeferencing_models, y_parallaxes and stereo_models.parquet."""
    oriented, parallaxes = comparison.oriented, comparison.parallaxes
    _write_points(folder, comparison)
    _write_points_in_models(folder, comparison)
    write_stage_table(folder, Y_PARALLAXES, parallax_columns(oriented, parallaxes))
    write_stage_table(folder, STEREO_MODELS, model_columns(oriented, parallaxes), oriented.map_frame)


def _write_points(folder: Path, comparison: Comparison) -> None:
    oriented, points = comparison.oriented, comparison.points
    places = np.zeros((0, 3))
    if len(points.surveyed):
        places = map_from_local(oriented.map_frame, oriented.frame, points.x_in_local)
    columns = {
        "point": np.array(comparison.surveyed.name, dtype=object)[points.surveyed],
        **{f"{axis}_m": places[:, k] for k, axis in enumerate("xyz")},
        **points.columns(comparison.independent),
    }
    write_stage_table(folder, DIRECT_GEOREFERENCING, columns, oriented.map_frame)


def _write_points_in_models(folder: Path, comparison: Comparison) -> None:
    images = np.array(comparison.oriented.given.image, dtype=object)
    rays, points = comparison.parallaxes.rays, comparison.in_models
    model = rays.common.model[comparison.pairs.pair]
    columns = {
        "left": images[rays.models.left[model]],
        "right": images[rays.models.right[model]],
        "point": np.array(comparison.surveyed.name, dtype=object)[points.surveyed],
        **points.columns(comparison.independent),
    }
    write_stage_table(folder, DIRECT_GEOREFERENCING_MODELS, columns)
