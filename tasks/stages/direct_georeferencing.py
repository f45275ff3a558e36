"""The direct-georeferencing check as a stage.

Orientations come from GNSS, INS and a calibration alone. Points intersected with them are compared with
surveyed points, and the y-parallaxes of all stereo models show how well neighbouring images fit. Both are
shown next to their predictions from the standard deviations of image points, GNSS/INS and calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from tasks.accuracy.check_points import CheckPointDifferences
from tasks.accuracy.statement import AccuracyClass, statements
from tasks.coordinates.crs import MapFrame
from tasks.files.json_text import JSON
from tasks.first_run import announce_compilation
from tasks.georeferencing.calibrated_identity import refuse_other_cameras
from tasks.georeferencing.calibration import (
    NO_CALIBRATION,
    Calibration,
    CalibrationFlight,
    calibration_of,
    calibration_of_results,
    control_of,
)
from tasks.georeferencing.comparison import Comparison, compared, write_comparison
from tasks.georeferencing.difference_statistics import difference_figures, parallax_figures
from tasks.georeferencing.directly_oriented import CheckRules, Delivery, DirectlyOriented, directly_oriented
from tasks.georeferencing.registered_calibration import RegisteredCalibration, calibration_of_registered
from tasks.georeferencing.remarks import (
    calibration_remarks,
    coverage_remarks,
    difference_remarks,
    parallax_remarks,
    point_remarks,
)
from tasks.quantities import is_calibrated
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.direct_georeferencing import DirectGeoreferencingSettings
from tasks.settings.project import ProjectSettings
from tasks.settings.quality import ChecksSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table


@stored("direct_georeferencing")
def check_georeferencing(
    folder: Path,
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    project: ProjectSettings,
    direct: DirectGeoreferencingSettings,
    adjustment: AdjustmentSettings,
    checks: ChecksSettings,
    parameters: Artifact | None = None,
    correlations: Artifact | None = None,
    parameter_influences: Artifact | None = None,
    control_residuals: Artifact | None = None,
    residual_grid: Artifact | None = None,
    registered: tuple[RegisteredCalibration, ...] = (),
) -> None:
    """Check direct georeferencing: differences at surveyed points, y-parallaxes, and their predictions.

    Writes direct_georeferencing, direct_georeferencing_models, y_parallaxes and stereo_models.parquet.

    Parameters
    ----------
    parameters, correlations, parameter_influences, control_residuals, residual_grid : of this project's own
        adjustment, where that is the calibration.
    registered : calibrations of the registry, where they are the calibration.

    Raises
    ------
    InputError
        If the calibration cannot be read or does not fit the cameras and flights.
    """
    announce_compilation()
    map_frame, surveyed = MapFrame.of(project.crs, project.heights), read_table(control_points)
    calibration = NO_CALIBRATION
    if registered:
        calibration = calibration_of_registered(registered, surveyed, map_frame.name)
    elif direct.calibration.is_of_results:
        given = read_table(cameras)
        refuse_other_cameras(direct.calibration, given[given["camera"].isin(read_table(exposures)["camera"])])
        calibration = calibration_of_results(direct.calibration)
    elif parameters is not None and correlations is not None and control_residuals is not None:
        own = _OwnAdjustment(parameters, correlations, control_residuals, parameter_influences)
        calibration = own.calibration(read_table(exposures), surveyed, map_frame)
    if residual_grid is not None:
        adjustment = _with_own_corrections(adjustment, residual_grid)
    delivery = Delivery(
        read_table(exposures), read_table(cameras), read_table(image_points), surveyed, map_frame
    )
    oriented = directly_oriented(delivery, calibration, CheckRules(direct, adjustment, checks))
    comparison = compared(oriented, surveyed, calibration, direct.critical_value)
    write_comparison(folder, comparison)
    figures = _figures(comparison, direct)
    figures["calibration"] = _applied_parameters(oriented, calibration)
    remarks = _remarks(comparison, calibration, figures)
    remarks += tuple(one.sentence for one in registered)
    write_notes(folder, Notes(remarks, {"direct_georeferencing": figures}))


@dataclass(frozen=True)
class _OwnAdjustment:
    """The tables of this project's own adjustment."""

    parameters: Artifact
    correlations: Artifact
    control_residuals: Artifact
    parameter_influences: Artifact | None

    def calibration(
        self, exposures: pd.DataFrame, surveyed: pd.DataFrame, map_frame: MapFrame
    ) -> Calibration:
        """Its estimates, with the points it used as control, and its own flight."""
        control = control_of(surveyed, read_table(self.control_residuals), map_frame.name)
        flight = None
        if self.parameter_influences is not None:
            influences = read_table(self.parameter_influences)
            flight = CalibrationFlight(influences, exposures, surveyed, map_frame.name)
        return calibration_of(read_table(self.parameters), read_table(self.correlations), control, flight)


def _with_own_corrections(adjustment: AdjustmentSettings, grid: Artifact) -> AdjustmentSettings:
    """Settings that name the mean residuals the adjustment added to the image coordinates, if it did."""
    if not read_table(grid)["correction_x_um"].notna().any():
        return adjustment
    named = adjustment.residual_grid.model_copy(update={"file": (grid.path,)})
    return adjustment.model_copy(update={"residual_grid": named})


def _figures(comparison: Comparison, direct: DirectGeoreferencingSettings) -> dict[str, JSON]:
    """Figures at the independent points, at the control of the calibration, in the models, and statements."""
    points, in_models, independent = comparison.points, comparison.in_models, comparison.independent
    chosen = independent[points.surveyed]
    found = CheckPointDifferences(points.difference[chosen], np.sqrt(points.survey_variance[chosen]))
    wanted = None if direct.accuracy_class_m is None else AccuracyClass(*direct.accuracy_class_m)
    return {
        **difference_figures(points, chosen, with_limits=True),
        "at_control_of_calibration": difference_figures(points, ~chosen, with_limits=True),
        "in_models": difference_figures(in_models, independent[in_models.surveyed], with_limits=False),
        "gsd_m": float(np.median(points.gsd)) if len(points.gsd) else None,
        "statements": [statement.to_json() for statement in statements(found, wanted)],
        **parallax_figures(comparison.parallaxes),
    }


def _remarks(comparison: Comparison, calibration: Calibration, figures: dict[str, JSON]) -> tuple[str, ...]:
    """Sentences about the results, the points they rest on, the calibration, and unused data."""
    chosen = comparison.independent[comparison.points.surveyed]
    has_models = len(comparison.parallaxes.rays.common.model) > 0
    return (
        *difference_remarks(figures, "independent check points"),
        *parallax_remarks(figures),
        *point_remarks(int(chosen.sum()), int((~chosen).sum()), is_known=not calibration.is_empty),
        *calibration_remarks(comparison.oriented, calibration),
        *coverage_remarks(comparison.oriented, comparison.not_intersected, has_models=has_models),
    )


def _applied_parameters(oriented: DirectlyOriented, calibration: Calibration) -> list[JSON]:
    """Parameter, entity, value, σ (null: taken to be free of error) and unit of everything that was applied.

    Biases and drifts of the calibration's own strips are not.
    """
    entities = {*oriented.given.mountings.names, *oriented.flights.values()}
    return [
        {
            "parameter": parameter,
            "entity": entity,
            "value": value,
            "sigma": calibration.sigmas.get((parameter, entity)),
            "unit": calibration.units[parameter, entity],
            "status": calibration.statuses[parameter, entity],
        }
        for (parameter, entity), value in calibration.values.items()
        if entity in entities and is_calibrated(parameter)
    ]
