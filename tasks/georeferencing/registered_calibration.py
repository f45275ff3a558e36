"""Calibrations from the registry as they are applied to the cameras of a project."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from tasks.calibration.record import CalibrationRecord
from tasks.files.json_text import JSON, from_json
from tasks.georeferencing.calibration import Calibration, SurveyedControl
from tasks.quantities import entity_kind
from tasks.tables.covariance import Key


@dataclass(frozen=True)
class RegisteredCalibration:
    """A calibration that was chosen for a camera; part of the key of the stage that applies it.

    Attributes
    ----------
    camera : name in the project.
    content : JSON of the record.
    digest : sha256 of the content.
    sentence : which one it is, since when, approved by whom.
    shares_control : whether it was made with a file of control points of this project.
    """

    camera: str
    content: str
    digest: str
    sentence: str
    shares_control: bool

    def key_content(self) -> JSON:
        """What identifies it: the digest stands for the content."""
        return {
            "camera": self.camera,
            "sha256": self.digest,
            "sentence": self.sentence,
            "shares_control": self.shares_control,
        }

    def input_files(self) -> tuple[Path, ...]:
        """It lies in no file."""
        return ()

    @property
    def record(self) -> CalibrationRecord:
        """The record."""
        return CalibrationRecord.model_validate(from_json(self.content))


def calibration_of_registered(
    chosen: tuple[RegisteredCalibration, ...], surveyed: pd.DataFrame, crs: str
) -> Calibration:
    """The calibration of all cameras of a project.

    Cameras and flights keep the names of the project, and the flights those of their records; where two
    records give a flight of the same name different values, its name is followed by that of the camera.
    Parameters of different records are not correlated.

    Parameters
    ----------
    surveyed : control_points.parquet, whose control points count as control of the calibration if the
        calibration was made with their file.
    crs : of their coordinates.
    """
    values, sigmas, of_one_flight = dict[Key, float](), dict[Key, float](), dict[Key, str | None]()
    units, statuses = dict[Key, str](), dict[Key, str]()
    correlations: dict[tuple[Key, Key], float] = {}
    ambiguous = _ambiguous_flights(chosen)
    for one in chosen:
        record = one.record
        name = _Names(record.camera.name, one.camera, ambiguous)
        for item in record.parameters:
            key = name.of(item.key)
            values[key], units[key], statuses[key] = item.value, item.unit, item.status
            if record.holds_in_one_flight(item):
                of_one_flight[key] = one.camera
        keys = [name.of(item.key) for item in record.estimated]
        own = np.array([item.sigma for item in record.estimated], dtype=np.float64)
        matrix = record.covariance_matrix / np.outer(own, own)
        sigmas |= dict(zip(keys, own.tolist(), strict=True))
        pairs = combinations(range(len(keys)), 2)
        correlations |= {(keys[i], keys[j]): float(matrix[i, j]) for i, j in pairs}
    known = {frozenset(pair) for pair in correlations}
    for pair in combinations(sigmas, 2):
        if frozenset(pair) not in known:
            correlations[pair] = 0.0
    shares = any(one.shares_control for one in chosen)
    control = _control(surveyed, crs) if shares else SurveyedControl()
    return Calibration(values, sigmas, units, correlations, statuses, control, of_one_flight)


@dataclass(frozen=True)
class _Names:
    """Names of a record → names in the project."""

    recorded: str
    camera: str
    ambiguous: frozenset[Key]

    def of(self, key: Key) -> Key:
        parameter, entity = key
        if entity_kind(parameter) == "camera":
            return parameter, self.camera + entity[len(self.recorded) :]
        return parameter, f"{entity} of {self.camera}" if key in self.ambiguous else entity


def _ambiguous_flights(chosen: tuple[RegisteredCalibration, ...]) -> frozenset[Key]:
    """Parameters of flights to which several records give different values."""
    counted = Counter(key for key, _ in {pair for one in chosen for pair in _of_flights(one.record)})
    return frozenset(key for key, count in counted.items() if count > 1)


def _of_flights(record: CalibrationRecord) -> Iterator[tuple[Key, float]]:
    for item in record.parameters:
        if entity_kind(item.parameter) != "camera":
            yield item.key, item.value


def _control(surveyed: pd.DataFrame, crs: str) -> SurveyedControl:
    own = surveyed[surveyed["role"] == "control"]
    return SurveyedControl(tuple(own["point"]), own[["x_m", "y_m", "z_m"]].to_numpy(np.float64), crs)
