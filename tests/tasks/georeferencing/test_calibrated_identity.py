"""A folder of results is applied to the camera it is of, and to no other."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from tasks.deliveries.cameras import write_cameras
from tasks.errors import InputError
from tasks.georeferencing.calibrated_identity import refuse_other_cameras
from tasks.settings.cameras import CameraInput
from tasks.settings.direct_georeferencing import CalibrationInput

IDENTITY = {"body": "UC-E-1", "lens": "L-4", "imu": "I-7", "mount": "hatch"}
GIVEN = {
    "columns": 13080,
    "rows": 20010,
    "pixel_um": 5.2,
    "focal_length_mm": 80.0,
    "principal_point_mm": [0.0, 0.0],
    "pixel_origin": "corner",
    "mount_deg": 90,
}
# What differs in the project, and what is said of it.
OTHERS = {
    "body": ({"identity": {**IDENTITY, "body": "UC-E-2"}}, "of another camera .body UC-E-1, lens L-4 there"),
    "lens": ({"identity": {**IDENTITY, "lens": "L-5"}}, "of another camera"),
    "no numbers": ({"identity": {}}, "of another camera .*, none here.*of another mounting"),
    "product": ({"identity": {**IDENTITY, "product": "camera_head"}}, "of a virtual image, and this is a"),
    "imu": ({"identity": {**IDENTITY, "imu": "I-8"}}, "of another mounting .IMU I-7"),
    "mount": ({"identity": {**IDENTITY, "mount": "pod"}}, "of another mounting"),
    "mount_deg": ({"mount_deg": 270}, "of another mounting"),
    "pixel": ({"pixel_um": 4.0}, "of another image .13080 × 20010 px of 5.2 µm"),
    "format": ({"columns": 20010, "rows": 13080}, "of another image"),
    "axes": ({"calibration_axes_deg": 90}, "of another image"),
}


def table(folder: Path, **changes: object) -> pd.DataFrame:
    """cameras.parquet of one camera in a folder."""
    camera = CameraInput.model_validate({**GIVEN, "identity": IDENTITY, **changes})
    folder.mkdir(exist_ok=True)
    write_cameras(folder / "cameras.parquet", {"UCE": camera})
    return pd.read_parquet(folder / "cameras.parquet")


def results(folder: Path) -> CalibrationInput:
    """A calibration whose table of cameras lies in a folder; the other tables are not checked."""
    names = ("parameters", "correlations", "control_residuals", "control_points", "cameras")
    return CalibrationInput.model_validate({name: folder / f"{name}.parquet" for name in names})


def test_the_same_camera_is_served_whatever_else_is_given_of_it(tmp_path: Path) -> None:
    table(tmp_path / "there")
    here = table(tmp_path / "here", focal_length_mm=79.9, lever_arm_m=[1.0, 0.0, 0.0], pixel_origin="centre")
    refuse_other_cameras(results(tmp_path / "there"), here)


def test_without_numbers_on_either_side_the_name_decides(tmp_path: Path) -> None:
    table(tmp_path / "there", identity={})
    refuse_other_cameras(results(tmp_path / "there"), table(tmp_path / "here", identity={}))


@pytest.mark.parametrize("kind", OTHERS)
def test_results_of_another_camera_are_refused_with_what_differs(tmp_path: Path, kind: str) -> None:
    changes, words = OTHERS[kind]
    table(tmp_path / "there")
    with pytest.raises(InputError, match=words) as error:
        refuse_other_cameras(results(tmp_path / "there"), table(tmp_path / "here", **changes))
    assert error.value.entity == "cameras.UCE"
    assert error.value.file == tmp_path / "there" / "cameras.parquet"


def test_results_that_do_not_say_of_what_they_are_are_refused(tmp_path: Path) -> None:
    here = table(tmp_path / "there")
    file = tmp_path / "there" / "cameras.parquet"
    whole = pq.read_table(file)
    pq.write_table(whole.drop_columns(["body"]), file)
    with pytest.raises(InputError, match="no column 'body'") as error:
        refuse_other_cameras(results(tmp_path / "there"), here)
    assert "repeat" in error.value.remedy
