"""Calibrations of rigs in the registry: a head that moved is named, one that did not is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from flows.runs.project_run import RunRequest, carry_out
from flows.stories.system_calibration import system_calibration
from tasks.calibration.record import CalibrationRecord
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.compatibility import ERROR_PROBABILITY, compatibility, single_limit
from tasks.registry.drift import DRIFT_PROBABILITY, DriftLimits, drift_between
from tasks.registry.registry import Registry, Signature
from tasks.settings.load_simulation import load_simulation
from tasks.settings.registry import registry_address
from tasks.simulation.simulate import simulate_project

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

SMALL = ("flight.lines=3", "flight.exposures=4", "points.count=200")
FREE = 'calibration.free=["boresight", "relative_rotation", "focal_length", "synchronisation_offset"]'
#: True minus stated rotation of the head *left* in the preset, degrees: roll, pitch, yaw.
LEFT = (0.012, -0.021, 0.017)
MOVED = ("relative_rotation_pitch", "left")
TRIALS = 200


def calibrated(folder: Path, seed: int, *changes: str) -> CalibrationRecord:
    """The record of a calibration flight of the preset."""
    simulation = load_simulation("penta", (*SMALL, *changes), seed)
    project = simulate_project(simulation, folder / f"flight-{seed}").project_file
    overrides = (FREE, f"project.flown=202{seed}-06-01")
    found = carry_out(system_calibration, RunRequest(project, folder / f"out-{seed}", overrides=overrides))
    assert found.error is None, found.error
    return CalibrationRecord.model_validate_json((found.directory / "calibration.json").read_text())


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CalibrationRecord]:
    """A folder, and the record of a first flight."""
    folder = tmp_path_factory.mktemp("rig")
    return folder, calibrated(folder, 3)


def places(record: CalibrationRecord) -> dict[tuple[str, str], int]:
    return {item.key: place for place, item in enumerate(record.estimated)}


def sigma_of_change(record: CalibrationRecord) -> float:
    """Of the pitch of *left* between two calibrations like this one."""
    return float(np.sqrt(2.0) * (record.estimated[places(record)[MOVED]].sigma or np.nan))


def with_values(record: CalibrationRecord, values: Floats) -> CalibrationRecord:
    given = dict(zip(places(record), values.tolist(), strict=True))
    items = tuple(
        item.model_copy(update={"value": given.get(item.key, item.value)}) for item in record.parameters
    )
    return record.model_copy(update={"parameters": items})


def test_a_flight_with_a_moved_head_names_it_and_one_with_the_same_rig_names_nothing(
    rig: tuple[Path, CalibrationRecord],
) -> None:
    folder, first = rig
    step = 8.0 * sigma_of_change(first)
    turned = [LEFT[0], LEFT[1] + step, LEFT[2]]
    records = (first, calibrated(folder, 4), calibrated(folder, 5, f"head.0.rotation_change_deg={turned}"))
    registry = Registry.at(registry_address(str(folder / "registry.sqlite")))
    for record in records:
        registry.add(SealedRecord.of(record), Signature("A. Engineer"))
    old, same, moved = registry.contents().calibrations
    assert old.camera.mounting_key == same.camera.mounting_key == moved.camera.mounting_key
    unchanged = drift_between(same, old, "before", DriftLimits())
    assert unchanged.test.agrees
    assert not unchanged.has_drifted
    assert not any(change.outstanding for change in unchanged.test.changes)
    # Boresight, rotations, focal lengths and offsets of five heads.
    assert len(unchanged.test.changes) >= 3 + 4 * 3 + 5 + 4
    changed = drift_between(moved, same, "before", DriftLimits())
    assert changed.has_drifted
    assert not changed.test.agrees
    assert {(one.change.parameter, one.change.head) for one in changed.parameters if one.exceeds} == {MOVED}
    assert "relative rotation pitch of left" in changed.sentence
    (found,) = (one.change for one in changed.parameters if one.exceeds)
    assert found.change == pytest.approx(step, abs=4.0 * found.sigma)


def test_an_unchanged_rig_is_called_changed_as_seldom_as_is_said(rig: tuple[Path, CalibrationRecord]) -> None:
    """Pairs drawn from the joint covariance of all heads; then one head moved by 5 σ of the difference."""
    _, record = rig
    matrix, value = record.covariance_matrix, np.array([item.value for item in record.estimated])
    sigma = np.sqrt(np.diagonal(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(sigma, sigma))
    root = sigma[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    step = np.zeros(len(value))
    step[places(record)[MOVED]] = 5.0 * sigma_of_change(record)
    random = np.random.default_rng(7)
    joint = single = drifted = named = others = 0
    squares = []
    for _ in range(TRIALS):
        one, other = value + random.standard_normal((2, len(value))) @ root.T
        old = with_values(record, one)
        same = compatibility(with_values(record, other), old)
        joint += not same.agrees
        single += any(change.outstanding for change in same.changes)
        drifted += bool(stats.chi2.sf(same.chi2, same.degrees_of_freedom) < DRIFT_PROBABILITY)
        squares.append(same.chi2)
        found = compatibility(with_values(record, other + step), old)
        names = {(change.parameter, change.head) for change in found.changes if change.outstanding}
        named += MOVED in names
        others += bool(names - {MOVED})
    _, high = stats.binom.interval(0.999, TRIALS, ERROR_PROBABILITY)
    assert max(joint, single, others) <= high
    assert drifted <= stats.binom.isf(0.0005, TRIALS, DRIFT_PROBABILITY)
    assert stats.kstest(squares, stats.chi2(same.degrees_of_freedom).cdf).pvalue > 0.001
    # 5 σ exceed the limit of the largest of all parameters unless chance takes more than the rest away.
    expected = stats.norm.sf(single_limit(len(same.changes)) - 5.0)
    low, high = stats.binom.interval(0.999, TRIALS, expected)
    assert low <= named <= high
