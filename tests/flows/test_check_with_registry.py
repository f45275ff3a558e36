"""A direct-georeferencing check takes its calibration from the registry, by camera and date."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from flows.stories.system_calibration import system_calibration
from tasks.calibration.record import CalibrationRecord
from tasks.coordinates.crs import MapFrame
from tasks.deliveries.cameras import write_cameras
from tasks.registry.calibration_file import read_calibrations
from tasks.registry.registry import Registry, Signature
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address
from tasks.simulation.simulate import simulate_project
from tasks.store.artifact import digest_of_file
from tasks.store.stage_record import read_records
from tasks.tables.parquet import write_table
from tasks.tables.schemas.adjustment import CONTROL_RESIDUALS
from tasks.tables.schemas.deliveries import CONTROL_POINTS
from tasks.tables.schemas.parameters import CORRELATIONS, PARAMETERS
from tests.tasks.registry.records import add, approve, changed, record

SMALL = ("points.count=500", "points.detection=0.6", "project.name=another")
#: Sixteen images.
SHORT = (*SMALL, "flight.0.exposures=4", "flight.1.exposures=4", "points.count=250")
FROM_REGISTRY = "direct_georeferencing.calibration=registry"
FLOWN = "project.flown=2024-06-01"
# The camera of the simulated flight has no numbers.
CAMERA, NAMELESS = "UCE-80", CameraIdentity()


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project file of a flight of the camera UCE-80."""
    folder = tmp_path_factory.mktemp("flight")
    return simulate_project(load_simulation("uce-high", SHORT, 2), folder).project_file


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry:
    """A registry with one calibration, approved from May 2024 on."""
    place = tmp_path / "registry.sqlite"
    monkeypatch.setenv(REGISTRY_VARIABLE, str(place))
    found = Registry.at(registry_address(str(place)))
    add(found, record(name=CAMERA, identity=NAMELESS))
    approve(found, 1, date(2024, 5, 2))
    return found


def results(folder: Path, calibration: CalibrationRecord) -> Path:
    """The tables an adjustment with the same result would have written."""
    folder.mkdir()
    frame = MapFrame.of("local", ELLIPSOIDAL)
    items, estimated = calibration.parameters, calibration.estimated
    columns = {
        name: [getattr(item, name) for item in items]
        for name in ("parameter", "entity", "value", "unit", "status")
    }
    sigma = [np.nan if item.sigma is None else item.sigma for item in items]
    columns |= {"sigma": sigma, "change": [0.0] * len(items)}
    write_table(folder / "parameters.parquet", PARAMETERS, columns)
    scale = np.sqrt(np.diagonal(calibration.covariance_matrix))
    matrix = calibration.covariance_matrix / np.outer(scale, scale)
    pairs = [(i, j) for i in range(len(estimated)) for j in range(i)]
    correlations: dict[str, object] = {
        f"{name}_{side}": [getattr(estimated[pair[k]], name) for pair in pairs]
        for k, side in enumerate("ab")
        for name in ("parameter", "entity")
    }
    correlations["correlation"] = [matrix[pair] for pair in pairs]
    write_table(folder / "correlations.parquet", CORRELATIONS, correlations)
    write_table(
        folder / "control_residuals.parquet",
        CONTROL_RESIDUALS,
        {"point": ["-"], "status": ["used"], "rays": [0]},
    )
    place = {f"{axis}_m": [0.0] for axis in "xyz"}
    control = {"point": ["-"], **place, "role": ["control"]}
    write_table(folder / "control_points.parquet", CONTROL_POINTS, control, frame)
    return folder


def check(project: Path, out: Path, *overrides: str) -> RunOutcome:
    return carry_out(direct_georeferencing_check, RunRequest(project, out, overrides))


def test_the_registry_gives_what_the_tables_of_the_same_calibration_give(
    registry: Registry, flight: Path, tmp_path: Path
) -> None:
    (stored,) = registry.contents().calibrations
    folder = results(tmp_path / "tables", stored.record)
    write_cameras(folder / "cameras.parquet", load_project(flight).cameras)
    tables = {}
    for name, source in (
        ("registry", FROM_REGISTRY),
        ("folder", f"direct_georeferencing.calibration={folder}"),
    ):
        outcome = check(flight, tmp_path / name, source, FLOWN)
        assert outcome.error is None, outcome.error
        tables[name] = pd.read_parquet(tmp_path / name / "direct_georeferencing.parquet").set_index("point")
    columns = [f"{kind}d{axis}_m" for kind in ("", "sigma_") for axis in "xyz"]
    assert len(tables["registry"]) > 20
    np.testing.assert_allclose(
        tables["registry"][columns].to_numpy(), tables["folder"][columns].to_numpy(), rtol=1e-9, atol=1e-12
    )
    # Points of another file are no control of the calibration.
    assert set(tables["registry"]["status"]) == {"independent"}
    summary = json.loads((tmp_path / "registry" / "summary.json").read_text())
    said = "The camera UCE-80 has calibration 1 (UCE-80, version 1) of the registry, valid from 2024-05-02"
    assert any(problem.startswith(said) for problem in summary["problems"])


def test_the_control_of_the_calibration_is_not_independent(
    registry: Registry, flight: Path, tmp_path: Path
) -> None:
    digest = digest_of_file(flight.parent / "control.csv")
    add(registry, record(changed(1), name=CAMERA, identity=NAMELESS, inputs={"renamed.csv": digest}))
    approve(registry, 2, date(2024, 5, 20))
    outcome = check(flight, tmp_path / "out", FROM_REGISTRY, FLOWN)
    assert outcome.error is None, outcome.error
    found = pd.read_parquet(tmp_path / "out" / "direct_georeferencing.parquet")
    roles = pd.read_parquet(tmp_path / "out" / "control_points.parquet").set_index("point")["role"]
    expected = [
        "independent" if roles[point] == "check" else "control_of_calibration" for point in found["point"]
    ]
    assert found["status"].tolist() == expected
    assert "control_of_calibration" in expected


def test_another_approved_calibration_repeats_the_check_and_the_same_one_does_not(
    registry: Registry, flight: Path, tmp_path: Path
) -> None:
    def checked() -> dict[str, bool]:
        outcome = check(flight, tmp_path / "out", FROM_REGISTRY, FLOWN)
        assert outcome.error is None, outcome.error
        return {one.stage: one.reused for one in read_records(tmp_path / "out" / ".store")}

    assert not checked()["direct_georeferencing"]
    assert checked()["direct_georeferencing"]
    add(registry, record(changed(1), name=CAMERA, identity=NAMELESS))
    assert checked()["direct_georeferencing"]  # a draft changes nothing
    approve(registry, 2, date(2024, 5, 20))
    again = checked()
    assert again["import_exposures"]
    assert not again["direct_georeferencing"]


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ((), "does not say when it was flown"),
        (("project.flown=2024-05-01",), "valid from 2024-05-02"),
        ((FLOWN, 'cameras.UCE-80.identity={body="UC-E-1"}'), "of another camera"),
        ((FLOWN, 'cameras.UCE-80.identity={imu="I-7"}'), "of another mounting"),
        (
            (FLOWN, 'cameras.UCE-80.identity={product="camera_head"}'),
            "of a virtual image, and this is a camera head",
        ),
    ],
)
def test_without_a_fitting_one_the_run_stops_and_names_the_near_ones(
    registry: Registry, flight: Path, tmp_path: Path, overrides: tuple[str, ...], words: str
) -> None:
    assert registry.contents().calibrations
    outcome = check(flight, tmp_path / "out", FROM_REGISTRY, *overrides)
    assert outcome.summary.status == "input_error"
    assert outcome.error is not None
    assert words in outcome.error
    assert "\n" not in outcome.error


@pytest.mark.slow
def test_from_the_calibration_flight_over_the_registry_to_the_next_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The calibration that `aerocal calibrate` writes gives what its folder of results gives."""
    monkeypatch.setenv(REGISTRY_VARIABLE, str(tmp_path / "registry.sqlite"))
    free = 'project.free=["boresight", "gnss_shift", "focal_length", "principal_point"]'
    field = simulate_project(load_simulation("uce-high", (*SMALL, free), 1), tmp_path / "field").project_file
    outcome = carry_out(system_calibration, RunRequest(field, overrides=("project.flown=2024-05-02",)))
    assert outcome.error is None, outcome.error
    registry = Registry.at(registry_address())
    (sealed,) = read_calibrations(field.parent / "results")
    assert sealed.record.flight.flown == date(2024, 5, 2)
    assert registry.add(sealed, Signature("ann")).sealed.digest == sealed.record.digest
    approve(registry, 1, date(2024, 5, 2), although="one height is enough for a test")
    flight = simulate_project(load_simulation("uce-high", SMALL, 2), tmp_path / "flight").project_file
    folder = f"direct_georeferencing.calibration={field.parent / 'results'}"
    tables = []
    for name, source in (("registry", FROM_REGISTRY), ("folder", folder)):
        outcome = check(flight, tmp_path / name, source, FLOWN)
        assert outcome.error is None, outcome.error
        tables.append(pd.read_parquet(tmp_path / name / "direct_georeferencing.parquet"))
    columns = [f"d{axis}_m" for axis in "xyz"]
    np.testing.assert_allclose(
        tables[0][columns].to_numpy(), tables[1][columns].to_numpy(), rtol=1e-6, atol=1e-9
    )
    # The record's σ contain what the calibration held; the tables of the adjustment have its own alone.
    sigmas = [f"sigma_{column}" for column in columns]
    assert (tables[0][sigmas].to_numpy() > tables[1][sigmas].to_numpy()).all()
    assert (tables[0][sigmas].to_numpy() < 2.0 * tables[1][sigmas].to_numpy()).all()
