"""A calibration as it is applied: values of system parameters with σ and correlations, and its control.

It comes from the tables of an adjustment, of this project or of another one. Values and σ are in the units of
those tables (mm, deg, m, s, or the unit an additional parameter is published in).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats
from tasks.errors import Location
from tasks.quantities import entity_kind, named
from tasks.settings.coordinates import LOCAL
from tasks.settings.direct_georeferencing import CalibrationInput
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of
from tasks.tables.foreign import read_foreign_table
from tasks.tables.schemas.adjustment import CONTROL_RESIDUALS
from tasks.tables.schemas.deliveries import CONTROL_POINTS, EXPOSURES
from tasks.tables.schemas.parameters import CORRELATIONS, PARAMETER_INFLUENCES, PARAMETERS

_REMEDY = "Name a folder with the results of `aerocal calibrate` or `aerocal adjust`."
# Of any parameter in these units.
_LARGEST = {"mm": 1e4, "deg": 360.0, "m": 1e4, "s": 1e4}
# Two surveys of one point differ by centimetres, neighbouring points lie metres apart.
_SAME_PLACE_M = 0.5


@dataclass(frozen=True, eq=False)
class SurveyedControl:
    """Points that were control of a calibration.

    Attributes
    ----------
    point : their names.
    x_in_map : (k, 3) coordinates; NaN where not known.
    crs : of the coordinates.
    """

    point: tuple[str, ...] = ()
    x_in_map: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    crs: str = ""

    def contains(self, point: Iterable[str], x_in_map: Floats, crs: str) -> Bools:
        """Which of other points (n,) with coordinates (n, 3) are among them.

        In the same CRS the place decides, with half a metre of tolerance: names are given again in every
        project. In another CRS it is the name; with local axes, which may be others, either of the two.
        """
        by_name = np.isin(np.array(list(point), dtype=object), np.array(self.point, dtype=object))
        if crs != self.crs:
            return by_name
        distance = np.abs(x_in_map[:, None, :2] - self.x_in_map[None, :, :2])
        here = np.all(distance < _SAME_PLACE_M, axis=2).any(axis=1)
        # A point known in height only has no place to be compared.
        named = by_name if crs == LOCAL else by_name & ~np.isfinite(x_in_map[:, :2]).all(axis=1)
        return np.asarray(here | named)


@dataclass(frozen=True, eq=False)
class CalibrationFlight:
    """The data a calibration was estimated from, and their influence on it.

    Attributes
    ----------
    influences : parameter_influences.parquet.
    exposures, control_points : the tables of its adjustment.
    crs : of their coordinates.
    """

    influences: pd.DataFrame
    exposures: pd.DataFrame
    control_points: pd.DataFrame
    crs: str


@dataclass(frozen=True, eq=False)
class Calibration:
    """Values of system parameters, and how well they are known.

    Attributes
    ----------
    values : of every parameter.
    sigmas : of those that were estimated.
    units : of every parameter.
    correlations : of pairs of estimated parameters, each pair once.
    statuses : what the calibration says about each, such as "significant".
    control : what it was made with.
    of_one_flight : parameters of a camera that hold in one flight alone → the camera; None: not known.
    flight : the observations it was made with; None: not known.
    """

    values: Mapping[Key, float]
    sigmas: Mapping[Key, float]
    units: Mapping[Key, str]
    correlations: Mapping[tuple[Key, Key], float]
    statuses: Mapping[Key, str]
    control: SurveyedControl
    of_one_flight: Mapping[Key, str | None] = field(default_factory=dict)
    flight: CalibrationFlight | None = None

    @property
    def is_empty(self) -> bool:
        """Whether it is empty, so that the values of the cameras apply."""
        return not self.values

    def entities(self, parameter: str) -> tuple[str, ...]:
        """Cameras, flights or strips that have a parameter."""
        return tuple(entity for name, entity in self.values if name == parameter)

    def covariance(self, keys: Iterable[Key]) -> Floats:
        """Covariance (k, k) of estimated parameters in the units of the tables.

        Raises
        ------
        InputError
            If the correlation of two of them is missing.
        """
        return covariance_of(keys, self.sigmas, self.correlations)


def control_of(surveyed: pd.DataFrame, residuals: pd.DataFrame, crs: str) -> SurveyedControl:
    """The points of control_points.parquet that were used as control: those in control_residuals."""
    own = surveyed[surveyed["point"].isin(residuals["point"])]
    return SurveyedControl(tuple(own["point"]), own[["x_m", "y_m", "z_m"]].to_numpy(np.float64), crs)


NO_CALIBRATION = Calibration({}, {}, {}, {}, {}, SurveyedControl())


def calibration_of(
    parameters: pd.DataFrame,
    correlations: pd.DataFrame,
    control: SurveyedControl,
    flight: CalibrationFlight | None = None,
) -> Calibration:
    """The calibration in parameters.parquet and correlations.parquet."""
    rows = parameters.to_dict("records")
    keys: list[Key] = [(str(row["parameter"]), str(row["entity"])) for row in rows]
    return Calibration(
        {key: float(row["value"]) for key, row in zip(keys, rows, strict=True)},
        sigmas_of(parameters),
        {key: str(row["unit"]) for key, row in zip(keys, rows, strict=True)},
        correlation_pairs(correlations),
        {key: str(row["status"]) for key, row in zip(keys, rows, strict=True)},
        control,
        _of_one_flight(parameters),
        flight,
    )


def _of_one_flight(parameters: pd.DataFrame) -> dict[Key, str | None]:
    """Camera of every parameter that applies to one flight only; None: an older table does not say."""
    of_camera = parameters["parameter"].map(entity_kind) == "camera"
    cameras = parameters.loc[parameters["parameter"] == "focal_length", "entity"]
    unsaid = parameters["camera"].isna() & ~parameters["entity"].isin(cameras)
    own = parameters[of_camera & (parameters["flight"].notna() | unsaid)]
    keys: list[Key] = list(zip(own["parameter"], own["entity"], strict=True))
    return dict(zip(keys, own["camera"].where(own["camera"].notna(), None), strict=True))


def calibration_of_results(source: CalibrationInput) -> Calibration:
    """The calibration in the results of another run.

    Raises
    ------
    InputError
        If a file is not the table its name says.
    """
    if (
        source.parameters is None
        or source.correlations is None
        or source.control_residuals is None
        or source.control_points is None
    ):
        raise ValueError("the calibration is not in the results of another run")
    residuals, _ = read_foreign_table(source.control_residuals, CONTROL_RESIDUALS, _REMEDY)
    surveyed, crs = read_foreign_table(source.control_points, CONTROL_POINTS, _REMEDY)
    control = control_of(surveyed, residuals, crs)
    parameters, _ = read_foreign_table(source.parameters, PARAMETERS, _REMEDY)
    _refuse_impossible(parameters, source.parameters)
    correlations, _ = read_foreign_table(source.correlations, CORRELATIONS, _REMEDY)
    flight = None
    if source.parameter_influences is not None and source.exposures is not None:
        influences, _ = read_foreign_table(source.parameter_influences, PARAMETER_INFLUENCES, _REMEDY)
        exposures, of_exposures = read_foreign_table(source.exposures, EXPOSURES, _REMEDY)
        if of_exposures == crs:
            flight = CalibrationFlight(influences, exposures, surveyed, crs)
    return calibration_of(parameters, correlations, control, flight)


def _refuse_impossible(parameters: pd.DataFrame, file: Path) -> None:
    """Refuse values that no camera, mounting or clock has: they are in another unit, or damaged."""
    for row in parameters.to_dict("records"):
        most = _LARGEST.get(str(row["unit"]))
        if most is not None and abs(row["value"]) > most:
            raise Location(file, entity=named(row["parameter"], row["entity"])).error(
                f"The value {row['value']:g} {row['unit']} is impossible.", _REMEDY
            )
