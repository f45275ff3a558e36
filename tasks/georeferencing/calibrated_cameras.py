"""The cameras of a project with the values of a calibration."""

from __future__ import annotations

import json

import pandas as pd

from tasks.errors import InputError
from tasks.georeferencing.calibration import Calibration
from tasks.nearest_name import did_you_mean
from tasks.quantities import COMPONENTS, is_additional

# Column of cameras.parquet of every parameter of a camera; both are in the same unit.
_COLUMNS = {
    name: f"{name}_{item.kind.unit}" for name, item in COMPONENTS.items() if item.kind.entity_kind == "camera"
}


def calibrated_cameras(cameras: pd.DataFrame, calibration: Calibration) -> pd.DataFrame:
    """cameras.parquet with the calibrated interior orientation, boresight, lever arm, additional parameters.

    Parameters
    ----------
    cameras : the cameras in use, as the project has them.

    Raises
    ------
    InputError
        If the calibration does not know a camera, or has additional parameters that apply to one flight only.
    """
    if calibration.is_empty:
        return cameras
    known = tuple(dict.fromkeys(calibration.entities("focal_length")))
    rows = []
    for row in cameras.to_dict("records"):
        name = str(row["camera"])
        if name not in known:
            raise InputError(
                f"The calibration contains no camera '{name}'.",
                f"{did_you_mean(name, known)} Name the camera as in the calibrated project.",
                entity=f"cameras.{name}",
            )
        row |= {
            column: calibration.values[parameter, name]
            for parameter, column in _COLUMNS.items()
            if (parameter, name) in calibration.values
        }
        row["additional_parameters"] = json.dumps(_additional(calibration, name), sort_keys=True)
        rows.append(row)
    return pd.DataFrame(rows, columns=cameras.columns)


def _additional(calibration: Calibration, camera: str) -> dict[str, float]:
    """Additional parameters of a camera."""
    found = {}
    for (parameter, entity), value in calibration.values.items():
        if not is_additional(parameter):
            continue
        if calibration.of_one_flight.get((parameter, entity), "") in (camera, None):
            raise of_one_flight(camera, entity)
        if entity == camera:
            found[parameter] = value
    return found


def of_one_flight(camera: str, entity: str) -> InputError:
    """The refusal of a calibration whose additional parameters belong to a camera in one flight."""
    return InputError(
        f"The calibration has separate additional parameters for '{entity}'; they are valid for that flight "
        "only.",
        'Calibrate with adjustment.self_calibration.per = "camera".',
        entity=f"cameras.{camera}",
    )
