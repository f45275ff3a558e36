"""A calibration is approved in the registry, and another project uses it: considered, observed or held."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.calibration.record import CalibratedCamera, CalibrationRecord
from tasks.registry.registry import Registry
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.conftest import COLUMNS, FOCAL_LENGTH_MM, PIXEL_UM, ROWS
from tests.tasks.registry.records import add, approve, parameter, record

CAMERA = CalibratedCamera(
    name="as calibrated", identity=CameraIdentity(body="B"), columns=COLUMNS, rows=ROWS, pixel_um=PIXEL_UM,
    mount_deg=0,
)  # fmt: skip
NAMES = ("focal_length", "principal_point_x", "principal_point_y", "boresight_roll", "boresight_pitch")
UNITS = ("mm", "mm", "mm", "deg", "deg")
SIGMAS = np.array([0.020, 0.004, 0.004, 0.002, 0.002])
WANTED = (
    "cameras.C.calibration=registry", 'cameras.C.identity={body="B"}', "project.flown=2024-06-01",
    "adjustment.free=[]",
)  # fmt: skip


def calibration(focal_length_mm: float = FOCAL_LENGTH_MM) -> CalibrationRecord:
    """Five parameters with correlations, and a shift of the flight that concerns nobody else."""
    values = (focal_length_mm, 0.0, 0.0, 0.0, 0.0)
    own = [parameter(*row, CAMERA.name) for row in zip(NAMES, UNITS, values, SIGMAS, strict=True)]
    correlations = np.eye(6)
    correlations[2, 3] = correlations[3, 2] = 0.6
    correlations[0, 5] = correlations[5, 0] = -0.8
    scale = np.append(SIGMAS, 0.01)
    return record(
        name=CAMERA.name,
        camera=CAMERA,
        parameters=(*own, parameter("gnss_shift_z", "m", 0.1, 0.01, "1")),
        covariance=tuple(map(tuple, (correlations * np.outer(scale, scale)).tolist())),
    )


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry:
    place = tmp_path / "registry.sqlite"
    monkeypatch.setenv(REGISTRY_VARIABLE, str(place))
    found = Registry.at(registry_address(str(place)))
    add(found, calibration())
    approve(found, 1, date(2024, 5, 2))
    return found


Adjust = Callable[..., Path]


@pytest.fixture
def adjust(block: Path, tmp_path: Path) -> Adjust:
    """Adjusts the block and returns the folder of its results."""

    def adjusted(name: str, *overrides: str, story: Story = adjustment_alone) -> Path:
        outcome = run(block, tmp_path / name, *WANTED, *overrides, story=story)
        assert outcome.error is None, outcome.error
        return tmp_path / name

    return adjusted


def run(block: Path, out: Path, *overrides: str, story: Story = adjustment_alone) -> RunOutcome:
    return carry_out(story, RunRequest(block, out, overrides))


def sigmas(folder: Path, name: str) -> np.ndarray:
    table = pd.read_parquet(folder / f"{name}.parquet")
    own = [column for column in table.columns if column.startswith("sigma_") and column.endswith("_m")]
    return table[own].to_numpy()


@pytest.mark.usefixtures("registry")
def test_the_errors_of_a_calibration_are_part_of_every_sigma(adjust: Adjust) -> None:
    held = adjust("held", 'cameras.C.calibration_use="held"')
    consider = adjust("consider", story=aerial_triangulation)
    prior = adjust("prior", 'cameras.C.calibration_use="prior"')
    for name in ("exterior_orientations", "object_points"):
        one, other = (pd.read_parquet(folder / f"{name}.parquet") for folder in (held, consider))
        accuracy = ("sigma", "correlation")
        floats = (column for column in one.columns if one[column].dtype == float)
        values = [column for column in floats if not column.startswith(accuracy)]
        pd.testing.assert_frame_equal(one[values], other[values])
    of_held, of_prior, of_considered = (sigmas(item, "object_points") for item in (held, prior, consider))
    assert (of_considered >= of_held).all()
    assert np.median(of_considered[:, 2] / of_held[:, 2]) > 1.1
    assert np.median(of_prior[:, 2]) <= np.median(of_considered[:, 2])
    checks = (sigmas(folder, "check_points") for folder in (held, consider))
    assert np.all(np.subtract(*checks) < 0.0)

    table = pd.read_parquet(consider / "parameters.parquet").set_index("parameter")
    assert (table.loc[list(NAMES), "status"] == "considered").all()
    np.testing.assert_allclose(table.loc[list(NAMES), "sigma"].to_numpy(), SIGMAS, rtol=1e-12)
    assert table.loc["boresight_yaw", "status"] == "fixed"
    pairs = pd.read_parquet(consider / "correlations.parquet").set_index(["parameter_a", "parameter_b"])
    assert len(pairs) == 10
    both = pairs.index.isin(
        [("principal_point_y", "boresight_roll"), ("boresight_roll", "principal_point_y")]
    )
    assert pairs.loc[both, "correlation"].item() == pytest.approx(0.6)
    observed = pd.read_parquet(prior / "parameters.parquet").set_index("parameter").loc[list(NAMES)]
    np.testing.assert_allclose(observed["sigma_prior"].to_numpy(), SIGMAS, rtol=1e-12)
    assert (observed["sigma_over_prior"] <= 1.0).all()

    said = json.loads((consider / "summary.json").read_text())
    (test,) = said["registered_calibrations"]
    assert (test["use"], test["parameters"], test["contradicted"]) == ("consider", 5, False)
    assert said["registered_calibration"] == test["probability"]
    predicted = np.sqrt(np.mean(sigmas(consider, "check_points") ** 2, axis=0))
    np.testing.assert_allclose(said["check_point_test"]["predicted_rmse_m"], predicted, rtol=1e-6)
    page = (consider / "report.html").read_text()
    assert "held, its σ included in all others" in page
    assert 'id="registered-calibrations"' in page
    assert "contradicts a calibration of the registry" not in page


def test_a_block_that_contradicts_the_registry_says_so_and_fails_its_gate(
    registry: Registry, block: Path, tmp_path: Path
) -> None:
    add(registry, calibration(FOCAL_LENGTH_MM + 10.0 * SIGMAS[0]))
    approve(registry, 2, date(2024, 5, 20))
    for use, story in (("consider", adjustment_alone), ("prior", aerial_triangulation)):
        outcome = run(
            block, tmp_path / use, *WANTED, f'cameras.C.calibration_use="{use}"',
            "gates.registered_calibration={min=0.001}", "gates.sigma0={max=100.0}", story=story,
        )  # fmt: skip
        assert outcome.error is None, outcome.error
        summary = json.loads((tmp_path / use / "summary.json").read_text())
        (test,) = summary["registered_calibrations"]
        assert test["contradicted"]
        assert any("contradicts the calibration of camera C" in item for item in summary["problems"])
        (gate,) = [item for item in summary["gates"] if item["name"] == "registered_calibration"]
        assert not gate["passed"]
    page = (tmp_path / "prior" / "report.html").read_text()
    assert "contradicts a calibration of the registry" in page


@pytest.mark.usefixtures("registry")
@pytest.mark.parametrize("free", [pytest.param("focal_length", marks=pytest.mark.slow), "boresight"])
def test_a_free_parameter_is_not_considered(block: Path, tmp_path: Path, free: str) -> None:
    overrides = (f'adjustment.free=["{free}"]',)
    outcome = run(block, tmp_path / "out", *WANTED, *overrides)
    assert outcome.error is not None
    assert "free in this project" in outcome.error
    assert "calibration_use" in outcome.error
    assert (
        run(block, tmp_path / "out", *WANTED, *overrides, 'cameras.C.calibration_use="prior"').error is None
    )


def test_another_covariance_computes_the_adjustment_again(adjust: Adjust, registry: Registry) -> None:
    before = sigmas(adjust("out"), "object_points")
    given = calibration()
    doubled = np.array(given.covariance) * 4.0
    parameters = [
        {**item.model_dump(), "sigma": None if item.sigma is None else 2.0 * item.sigma}
        for item in given.parameters
    ]
    changes = {"covariance": tuple(map(tuple, doubled.tolist())), "parameters": parameters}
    add(registry, CalibrationRecord.model_validate({**given.model_dump(), **changes}))
    approve(registry, 2, date(2024, 5, 20))
    assert (sigmas(adjust("out"), "object_points")[:, 2] > before[:, 2]).all()


def test_what_becomes_of_a_covariance_is_no_question_without_registry(block: Path, tmp_path: Path) -> None:
    outcome = run(block, tmp_path / "out", 'cameras.C.calibration_use="prior"')
    assert outcome.error is not None
    assert "values of this camera are given here" in outcome.error
