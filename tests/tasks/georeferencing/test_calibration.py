"""Calibrations: covariances, who was control, cameras and flights they fit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.georeferencing.calibrated_cameras import calibrated_cameras
from tasks.georeferencing.calibrated_system import calibrated_flights
from tasks.georeferencing.calibration import (
    NO_CALIBRATION,
    Calibration,
    SurveyedControl,
    calibration_of,
    calibration_of_results,
)
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.direct_georeferencing import CalibrationInput
from tasks.tables.parquet import write_table
from tasks.tables.schemas import adjustment, deliveries, parameters

PARAMETERS = pd.DataFrame(
    [
        ("focal_length", "C", 79.992, 0.001, "mm", "significant"),
        ("principal_point_x", "C", 0.004, np.nan, "mm", "fixed"),
        ("principal_point_y", "C", -0.006, np.nan, "mm", "fixed"),
        ("boresight_roll", "C", 0.0047, 0.0003, "deg", "significant"),
        ("lever_arm_x", "C", 0.3, np.nan, "m", "fixed"),
        ("gnss_shift_x", "1", -0.262, 0.01, "m", "significant"),
        ("gnss_shift_y", "1", 0.123, 0.01, "m", "significant"),
        ("gnss_shift_z", "1", 0.286, 0.02, "m", "significant"),
        ("bluh:9", "C", 1.5e-9, 2e-10, "1/mm²", "significant"),
    ],
    columns=["parameter", "entity", "value", "sigma", "unit", "status"],
).assign(camera=lambda table: table["entity"].where(table["entity"] == "C"), flight=None)
CORRELATIONS = pd.DataFrame(
    [("focal_length", "C", "gnss_shift_z", "1", -0.8), ("boresight_roll", "C", "focal_length", "C", 0.1)],
    columns=["parameter_a", "entity_a", "parameter_b", "entity_b", "correlation"],
)
CAMERAS = pd.DataFrame(
    [
        {
            "camera": "C",
            "focal_length_mm": 80.0,
            "principal_point_x_mm": 0.0,
            "principal_point_y_mm": 0.0,
            "boresight_roll_deg": 0.0,
            "reduced_by_x_m": 0.0,
            "reduced_by_y_m": 0.0,
            "reduced_by_z_m": 0.0,
            "lever_arm_x_m": 0.0,
            "lever_arm_y_m": 0.7,
            "additional_parameters": "{}",
        }
    ]
)


def calibration(
    extra: tuple[tuple[object, ...], ...] = (), without: str = "", control: SurveyedControl | None = None
) -> Calibration:
    rows = [(*row, None, None)[: len(PARAMETERS.columns)] for row in extra]
    table = pd.concat([PARAMETERS, pd.DataFrame(rows, columns=PARAMETERS.columns)], ignore_index=True)
    return calibration_of(table[table["parameter"] != without], CORRELATIONS, control or SurveyedControl())


def test_the_covariance_has_the_sigmas_and_correlations_of_the_tables() -> None:
    found = calibration().covariance([("gnss_shift_z", "1"), ("focal_length", "C")])
    np.testing.assert_allclose(found, [[4e-4, -0.8 * 0.02 * 0.001], [-0.8 * 0.02 * 0.001, 1e-6]])


def test_a_missing_correlation_is_an_error_and_not_a_zero() -> None:
    with pytest.raises(InputError, match="no correlation of gnss_shift_z of 1 with boresight_roll of C"):
        calibration().covariance([("boresight_roll", "C"), ("gnss_shift_z", "1")])


def test_cameras_take_the_calibrated_values() -> None:
    row = calibrated_cameras(CAMERAS, calibration()).iloc[0]
    assert row["focal_length_mm"] == 79.992
    assert row["principal_point_y_mm"] == -0.006
    assert row["boresight_roll_deg"] == 0.0047
    assert row["lever_arm_x_m"] == 0.3
    assert row["lever_arm_y_m"] == 0.7  # the calibration does not speak of it
    assert json.loads(row["additional_parameters"]) == {"bluh:9": 1.5e-9}


def test_without_a_calibration_cameras_stay_as_they_are() -> None:
    pd.testing.assert_frame_equal(calibrated_cameras(CAMERAS, NO_CALIBRATION), CAMERAS)


def test_a_camera_the_calibration_does_not_know_is_refused() -> None:
    with pytest.raises(InputError, match="contains no camera 'D'") as error:
        calibrated_cameras(CAMERAS.assign(camera="D"), calibration())
    assert "'C'" in error.value.remedy


def test_additional_parameters_of_one_flight_hold_for_no_other() -> None:
    row = ("bluh:10", "C in 2", 1e-9, 1e-10, "1/mm²", "significant", "C", "2")
    with pytest.raises(InputError, match="are valid for that flight only"):
        calibrated_cameras(CAMERAS, calibration((row,)))


def test_additional_parameters_of_one_flight_in_a_table_that_does_not_name_their_camera_are_refused() -> None:
    row = ("bluh:10", "C in 2", 1e-9, 1e-10, "1/mm²", "significant", None, None)
    with pytest.raises(InputError, match="are valid for that flight only"):
        calibrated_cameras(CAMERAS, calibration((row,)))


def test_a_camera_may_be_called_like_another_one_in_a_flight() -> None:
    rows = (
        ("focal_length", "C in 2", 79.5, 0.001, "mm", "significant", "C in 2", None),
        ("bluh:10", "C in 2", 1e-9, 1e-10, "1/mm²", "significant", "C in 2", None),
    )
    first, second = (
        calibrated_cameras(CAMERAS.assign(camera=name), calibration(rows)).iloc[0] for name in ("C", "C in 2")
    )
    assert json.loads(first["additional_parameters"]) == {"bluh:9": 1.5e-9}
    assert json.loads(second["additional_parameters"]) == {"bluh:10": 1e-9}
    assert (first["focal_length_mm"], second["focal_length_mm"]) == (79.992, 79.5)


def test_the_only_flight_of_a_calibration_serves_every_flight() -> None:
    assert calibrated_flights(calibration(), ("7", "8"), None) == {"7": "1", "8": "1"}
    assert calibrated_flights(calibration(), ("1",), None) == {"1": "1"}
    assert calibrated_flights(NO_CALIBRATION, ("1",), None) == {}
    with pytest.raises(InputError, match="has none of any flight"):
        calibrated_flights(NO_CALIBRATION, ("1",), "1")


def test_several_flights_go_by_their_names_or_by_the_setting() -> None:
    several = calibration((("gnss_shift_x", "2", 0.1, 0.01, "m", "significant"),))
    assert calibrated_flights(several, ("2", "1"), None) == {"2": "2", "1": "1"}
    assert calibrated_flights(several, ("7",), "2") == {"7": "2"}
    with pytest.raises(InputError, match="no GNSS shift for the flight '7'"):
        calibrated_flights(several, ("7",), None)
    with pytest.raises(InputError, match="no GNSS shift for the flight '12'"):
        calibrated_flights(calibration(), ("1",), "12")


PLACES = np.array([[100.0, 200.0, 5.0], [300.0, 200.0, 6.0], [np.nan, np.nan, 7.0]])
CONTROL = SurveyedControl(("A", "B", "H"), PLACES, "EPSG:25832")


@pytest.mark.parametrize(
    ("crs", "expected"),
    [
        # By place: the same point under another name, another point under the same name, height only.
        ("EPSG:25832", [True, False, True, False]),
        ("EPSG:2154", [False, True, True, False]),
        ("local", [False, True, True, False]),
    ],
)
def test_control_of_the_calibration_is_recognised(crs: str, expected: list[bool]) -> None:
    places = np.array([[100.1, 199.8, 5.1], [900.0, 900.0, 5.0], [np.nan, np.nan, 7.0], [0.0, 0.0, 0.0]])
    assert CONTROL.contains(["1001", "B", "H", "new"], places, crs).tolist() == expected


def test_local_axes_may_be_others_so_place_or_name_decides() -> None:
    local = SurveyedControl(("A",), PLACES[:1], "local")
    places = np.array([[100.1, 199.8, 5.1], [900.0, 900.0, 5.0], [1.0, 1.0, 1.0]])
    assert local.contains(["1001", "A", "new"], places, "local").tolist() == [True, True, False]


def results(folder: Path) -> CalibrationInput:
    """The tables of a folder of results."""
    frame = MapFrame.of("EPSG:25832", ELLIPSOIDAL)
    columns: Mapping[str, object] = {
        **PARAMETERS.to_dict("series"),
        "change": np.zeros(len(PARAMETERS)),
    }
    write_table(folder / "parameters.parquet", parameters.PARAMETERS, columns)
    write_table(folder / "correlations.parquet", parameters.CORRELATIONS, CORRELATIONS.to_dict("series"))
    write_table(
        folder / "control_residuals.parquet",
        adjustment.CONTROL_RESIDUALS,
        {"point": ["B"], "status": ["used"], "rays": [4]},
    )
    write_table(
        folder / "control_points.parquet",
        deliveries.CONTROL_POINTS,
        {
            "point": ["A", "B"],
            **{f"{axis}_m": PLACES[:2, k] for k, axis in enumerate("xyz")},
            "role": ["control", "control"],
        },
        frame,
    )
    names = ("parameters", "correlations", "control_residuals", "control_points", "cameras")
    return CalibrationInput.model_validate({name: folder / f"{name}.parquet" for name in names})


def test_results_of_another_project_are_read_with_the_control_that_took_part(tmp_path: Path) -> None:
    found = calibration_of_results(results(tmp_path))
    assert found.values["focal_length", "C"] == 79.992
    assert set(found.sigmas) == {
        ("focal_length", "C"),
        ("boresight_roll", "C"),
        *((f"gnss_shift_{axis}", "1") for axis in "xyz"),
        ("bluh:9", "C"),
    }
    assert found.control.point == ("B",)
    assert found.control.crs == "EPSG:25832"


@pytest.mark.parametrize("damage", ["text", "other"])
def test_a_file_that_is_not_its_table_is_refused_with_its_name(tmp_path: Path, damage: str) -> None:
    source = results(tmp_path)
    target = tmp_path / "correlations.parquet"
    if damage == "text":
        target.write_text("no table")
    else:
        target.write_bytes((tmp_path / "parameters.parquet").read_bytes())
    with pytest.raises(InputError) as error:
        calibration_of_results(source)
    assert error.value.file == target
    assert "folder with the results" in error.value.remedy
