"""What a calibration and the flight it is applied to have in common: exposures, strips and control.

The data decide: an exposure is the same if image, flight, position and angles are, a surveyed point if its
coordinates are. A calibration that shares none comes from another flight and is independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.georeferencing.direct_orientation import DirectOrientations
from adjust.georeferencing.error_sources import SharedErrors
from tasks.block.block_input import SurveyedPoints
from tasks.block.given_orientations import GivenOrientations
from tasks.block.shared_readings import heads_of_reading
from tasks.georeferencing.calibrated_system import CalibratedSystem
from tasks.georeferencing.calibration import CalibrationFlight
from tasks.tables.number_columns import numbers_of

_XYZ = ["x_m", "y_m", "z_m"]
_ANGLES = ["omega_deg", "phi_deg", "kappa_deg", "heading_deg", "pitch_deg", "roll_deg"]
# Readings are copied, not measured again: what is left is the rounding of a file.
_SAME_M, _SAME_DEG = 1e-5, 1e-7
_BY, _SIGMA = ["by_x", "by_y", "by_z"], ["sigma_x", "sigma_y", "sigma_z"]
_DEGREE = float(np.rad2deg(1.0))


@dataclass(frozen=True)
class SharedExposures:
    """How many of the exposures of a calibration are also those of a check; both 0 if unknown."""

    shared: int = 0
    of_calibration: int = 0


def same_exposures(flight: CalibrationFlight, exposures: pd.DataFrame, crs: str) -> frozenset[str]:
    """Images whose exposures are the same in the calibration and in exposures.parquet."""
    if flight.crs != crs:
        return frozenset()
    both = exposures.merge(flight.exposures, on="image", suffixes=("", "_there"))
    same = both["flight"].fillna("") == both["flight_there"].fillna("")
    for names, tolerance in ((_XYZ, _SAME_M), (_ANGLES, _SAME_DEG)):
        here, there = (numbers_of(both, [f"{name}{end}" for name in names]) for end in ("", "_there"))
        close = np.isclose(here, there, rtol=0.0, atol=tolerance, equal_nan=True)
        same &= np.asarray(close.all(axis=1))
    return frozenset(both.loc[same, "image"])


def _same_control(flight: CalibrationFlight, control_points: pd.DataFrame) -> pd.Series:
    """Names in the calibration of the points of control_points.parquet; empty for missing ones."""
    here, there = (numbers_of(table, _XYZ) for table in (control_points, flight.control_points))
    names = np.full(len(here), "", dtype=object)
    for row, place in enumerate(here):
        same = np.isclose(there, place, rtol=0.0, atol=_SAME_M, equal_nan=True).all(axis=1)
        if same.any():
            names[row] = flight.control_points["point"].to_numpy()[np.argmax(same)]
    return pd.Series(names)


def shared_errors(
    flight: CalibrationFlight,
    images: frozenset[str],
    system: CalibratedSystem,
    given: GivenOrientations,
    orientations: DirectOrientations,
    surveyed: SurveyedPoints,
    control_points: pd.DataFrame,
) -> SharedErrors:
    """Errors that the calibrated parameters of a block share with its own observations.

    Parameters
    ----------
    images : whose exposures are the same.
    surveyed, control_points : the same points, in the same order.
    """
    table, strips = _Influences(flight.influences, system), given.strips
    own = np.array([name if name in images else "" for name in given.image], dtype=object)
    of_position, position_sigma = table.of("position", own)
    of_attitude, attitude_sigma = table.of("attitude", own)
    touched = np.unique(given.strip_of_image[own != ""])
    named = np.array([name if k in touched else "\0" for k, name in enumerate(strips)], dtype=object)
    _, bias_sigma = table.of("strip_bias", named)
    of_survey, survey_sigma = table.of("control", _same_control(flight, control_points).to_numpy())
    spread = np.linalg.solve(orientations.of_observations, orientations.of_noise)
    stated = np.sqrt(np.diagonal(spread @ np.swapaxes(spread, 1, 2), axis1=1, axis2=2))
    # The adjustment counts a reading of several heads with a larger σ for each, here it is one error of all.
    stated = stated * np.sqrt(heads_of_reading(given))[:, None]
    survey_stated = np.sqrt(np.diagonal(surveyed.covariance, axis1=1, axis2=2))
    return SharedErrors(
        np.concatenate([of_position, of_attitude * _DEGREE], axis=2),
        of_survey,
        _roots(surveyed.covariance),
        np.hstack([position_sigma, attitude_sigma / _DEGREE]) / stated,
        np.hstack([bias_sigma, np.zeros_like(bias_sigma)]),
        _over(survey_sigma, survey_stated),
    )


@dataclass(frozen=True, eq=False)
class _Influences:
    """parameter_influences.parquet for the parameters of a system."""

    table: pd.DataFrame
    system: CalibratedSystem

    def of(self, kind: str, names: np.ndarray) -> tuple[Floats, Floats]:
        """(k, n, 3) derivatives of the parameters in SI, and (n, 3) σ; zero where there is no observation."""
        rows = self.table[self.table["observation"] == kind]
        derivative, sigma = np.zeros((len(self.system.estimated), len(names), 3)), np.zeros((len(names), 3))
        for k, ((parameter, entity), factor) in enumerate(self.system.estimated):
            own = rows[(rows["parameter"] == parameter) & (rows["entity"] == entity)]
            place: Ints = pd.Index(own["name"]).get_indexer(pd.Index(names))
            known = place >= 0
            derivative[k, known] = numbers_of(own, _BY)[place[known]] / factor
            sigma[known] = np.nan_to_num(numbers_of(own, _SIGMA)[place[known]])
        return derivative, sigma


def _over(one: Floats, other: Floats) -> Floats:
    return np.divide(one, other, out=np.zeros_like(one), where=other > 0.0)


def _roots(covariance: Floats) -> Floats:
    """L (c, 3, 3) with L Lᵀ = covariance; coordinates with σ = 0 stay without error."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])
