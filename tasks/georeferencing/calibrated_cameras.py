"""The cameras of a project as a calibration has them."""

from __future__ import annotations

import json

import pandas as pd

from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from tasks.errors import InputError
from tasks.georeferencing.calibration import Calibration
from tasks.nearest_name import did_you_mean
from tasks.tables.covariance import Key

#: Column of cameras.parquet of every parameter of a camera; both are in the same unit.
_COLUMNS = {
    "focal_length": "focal_length_mm",
    "principal_point_x": "principal_point_x_mm",
    "principal_point_y": "principal_point_y_mm",
    **{f"boresight_{name}": f"boresight_{name}_deg" for name in ("roll", "pitch", "yaw")},
    **{f"lever_arm_{axis}": f"lever_arm_{axis}_m" for axis in "xyz"},
}
#: Families that stay behind with the flight that was calibrated.
OF_ITS_FLIGHT = (GNSS_STRIP_BIAS, GNSS_DRIFT)
_OTHERS = {
    component for name in (GNSS_SHIFT, TIME_OFFSET, *OF_ITS_FLIGHT) for component in FAMILIES[name].components
}
_OF_CAMERAS = {c for name in (INTERIOR_ORIENTATION, BORESIGHT, LEVER_ARM) for c in FAMILIES[name].components}


def calibrated_cameras(cameras: pd.DataFrame, calibration: Calibration) -> pd.DataFrame:
    """cameras.parquet with the calibrated interior orientation, boresight, lever arm, additional parameters.

    Parameters
    ----------
    cameras : the cameras in use, as the project has them.

    Raises
    ------
    InputError
        If the calibration does not know a camera, or has additional parameters that hold for one flight only.
    """
    if calibration.is_empty:
        return cameras
    known = tuple(dict.fromkeys(calibration.entities("focal_length")))
    rows = []
    for row in cameras.to_dict("records"):
        name = str(row["camera"])
        if name not in known:
            raise InputError(
                f"The calibration knows no camera '{name}'.",
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
    for key, value in calibration.values.items():
        if not is_additional(key):
            continue
        parameter, entity = key
        if entity == camera:
            found[parameter] = value
        elif entity.startswith(f"{camera} in "):
            raise InputError(
                f"The calibration has additional parameters of their own for '{entity}'; they hold for no "
                "other flight.",
                'Calibrate with adjustment.self_calibration.per = "camera".',
                entity=f"cameras.{camera}",
            )
    return found


def is_additional(key: Key) -> bool:
    """Whether a parameter is an additional parameter SET:NAME."""
    return key[0] not in _OTHERS and key[0] not in _OF_CAMERAS


def is_of_camera(parameter: str) -> bool:
    """Whether a parameter belongs to a camera and its mounting, and not to a flight."""
    return parameter not in _OTHERS
