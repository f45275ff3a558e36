"""The cameras with their calibrated interior orientation, used by the first of two steps.

An adjustment on control alone cannot separate the focal length from the flying height. It takes the interior
orientation from the one-step calibration (two flying heights and GNSS), not from the certificate, whose error
would end up in the projection centres.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from tasks.georeferencing.calibrated_cameras import calibrated_cameras
from tasks.georeferencing.calibration import SurveyedControl, calibration_of
from tasks.store.artifact import Artifact
from tasks.store.store import stored
from tasks.tables.parquet import read_table, write_stage_table
from tasks.tables.schemas.deliveries import CAMERAS


@stored("calibrated_cameras")
def apply_to_cameras(
    folder: Path, *, cameras: Artifact, parameters: Artifact, correlations: Artifact
) -> None:
    """Write ``cameras.parquet`` with the values of a one-step calibration; unused cameras as given."""
    calibration = calibration_of(read_table(parameters), read_table(correlations), SurveyedControl())
    given = read_table(cameras)
    in_use = given["camera"].isin(calibration.entities("focal_length"))
    table = pd.concat([calibrated_cameras(given[in_use], calibration), given[~in_use]])
    write_stage_table(folder, CAMERAS, table)
