"""`aerocal calibrate` on a close-range calibration: DBAT's camera, from text files to the record.

21 photos of a sheet of marks, turned about all axes; four of the marks are control, nothing else is known.
Values: as DBAT 0.9.2 prints them for its model 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.geometry import rotation
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.calibration.record import CalibrationRecord
from tests.flows.calibration_alone import calibration_alone
from tests.golden.dbat import read_report
from tests.golden.dbat_camcal import (
    COLUMNS,
    FOCAL_LENGTH_MM,
    PIXEL_MM,
    ROWS,
    Network,
    block_of,
    read_network,
)

EXPOSURES = """\
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "local"
position = "projection_centre"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
"""
PROJECT = f"""
version = 1
[project]
name = "camcal"
crs = "local"
[cameras.C4040Z]
columns = {COLUMNS}
rows = {ROWS}
pixel_um = {PIXEL_MM * 1e3!r}
focal_length_mm = {FOCAL_LENGTH_MM}
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "image_points.csv"
format = "csv"
unit = "px"
sigma = 0.1
{EXPOSURES}[inputs.control]
file = "control.csv"
format = "csv"
crs = "local"
sigma_m = 1e-8
[adjustment]
observe = ["control"]
refraction = "none"
rejection = "none"
self_calibration = {{ parameters = "brown_mm:K1-P2", elimination = "none" }}
[calibration]
variance_components = false
"""


@pytest.fixture(scope="module", params=["with start values", "without exposures"])
def calibrated(
    test_data: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> RunOutcome:
    """Once from resections made for the test; once from image points and four control points alone."""
    network = read_network(test_data / "dbat_camcal")
    folder = tmp_path_factory.mktemp("camcal")
    alone = request.param == "without exposures"
    (folder / "project.toml").write_text(PROJECT.replace(EXPOSURES, "") if alone else PROJECT)
    image, point = (
        np.array(names)[rows]
        for names, rows in ((network.images, network.image), (network.points, network.point))
    )
    x, y = network.pixel.T
    pd.DataFrame({"image": image, "point": point, "x": x, "y": y}).to_csv(
        folder / "image_points.csv", index=False
    )
    names = np.array(network.points)[network.control]
    x, y, z = network.control_position.T
    pd.DataFrame({"point": names, "x": x, "y": y, "z": z}).to_csv(folder / "control.csv", index=False)
    if not alone:
        write_exposures(folder, network)
    outcome = carry_out(calibration_alone, RunRequest(folder / "project.toml"))
    assert outcome.error is None, outcome.error
    return outcome


def write_exposures(folder: Path, network: Network) -> None:
    block, _ = block_of(network, "brown_mm:K1-P2")
    angles = np.rad2deg(rotation.to_omega_phi_kappa(block.local_from_camera))
    exposures = pd.DataFrame({"image": network.images, "camera": "C4040Z", "strip": ""})
    exposures[["x", "y", "z"]] = block.projection_centre
    exposures[["omega", "phi", "kappa"]] = angles
    exposures.to_csv(folder / "exposures.csv", index=False)


def test_the_camera_is_dbat_s(calibrated: RunOutcome, test_data: Path) -> None:
    """To a hundredth of its standard deviation: held quantities are part of ours, and DBAT stops earlier."""
    record = record_of(calibrated)
    report = read_report(test_data / "dbat_camcal" / "reference" / "camcal-dbatreport-model1.txt")
    found = {item.parameter: item for item in record.parameters}
    for name, label, begin, sign in (
        ("focal_length", "Camera Constant", 0.0, 1.0),
        ("principal_point_x", "px", 0.5 * COLUMNS * PIXEL_MM, 1.0),
        ("principal_point_y", "py", 0.5 * ROWS * PIXEL_MM, -1.0),
        ("brown_mm:K1", "K1", 0.0, 1.0),
        ("brown_mm:K3", "K3", 0.0, 1.0),
        ("brown_mm:P2", "P2", 0.0, 1.0),
    ):
        printed, sigma = float(report.camera[label].value), found[name].sigma
        assert sigma == pytest.approx(float(report.camera[label].deviation), rel=0.01)
        last_digit = 10.0 ** -len(report.camera[label].value.partition(".")[2].partition("e")[0])
        last_digit *= 10.0 ** float(report.camera[label].value.partition("e")[2] or 0)
        assert abs(begin + sign * found[name].value - printed) < 0.01 * sigma + last_digit


def test_what_its_model_lacks_is_named_and_what_has_no_meaning_is_not_asked(calibrated: RunOutcome) -> None:
    """DBAT's model 3 adds an aspect parameter and finds 19 σ; refraction and lines do not matter."""
    record = record_of(calibrated)
    assert record.verdict == "refused"
    assert "B1 +0.0" in record.reasons[0]
    everything = " ".join((*record.reasons, *record.remarks))
    assert "efraction" not in everything
    assert "heading" not in everything
    assert "No GNSS positions are observed" in everything
    assert "no two-step calibration" in everything
    held = {item.parameter for item in record.parameters if item.verdict == "held"}
    assert {"boresight_roll", "lever_arm_x"} <= held


def record_of(outcome: RunOutcome) -> CalibrationRecord:
    return CalibrationRecord.model_validate_json((outcome.directory / "calibration.json").read_text())
