"""The calibration of a rig in the registry: one record of all heads, used with the joint covariance."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.system_calibration import system_calibration
from tasks.calibration.record import CalibrationRecord
from tasks.errors import InputError
from tasks.registry.approval import approval_of
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.history import Validity
from tasks.registry.registry import Registry, Signature
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.settings.registry import registry_address
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.calibration_alone import calibration_alone

_SMALL = ("flight.lines=3", "flight.exposures=4", "points.count=200")
_DAY = "project.flown=2026-06-01"
_RIG = (_DAY, 'cameras.nadir.calibration="registry-rig"')
_FREE = 'calibration.free=["boresight", "relative_rotation", "focal_length", "synchronisation_offset"]'
_HEADS = ["backward", "forward", "left", "right"]


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A calibration flight and a later one with the same cameras."""
    folder = tmp_path_factory.mktemp("flights")
    first, second = (
        simulate_project(load_simulation("penta", _SMALL, seed), folder / str(seed)).project_file
        for seed in (3, 4)
    )
    return first, second


@pytest.fixture(scope="module")
def registered(flights: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Results of the calibration, and the registry in which it is approved."""
    folder = tmp_path_factory.mktemp("registry")
    found = carry_out(system_calibration, RunRequest(flights[0], folder / "out", overrides=(_FREE, _DAY)))
    assert found.error is None, found.error
    at = ["--registry", str(folder / "registry.sqlite"), "--by", "A. Engineer"]
    assert aerocal("registry", "add", found.directory, *at).returncode == 0
    although = ["--although", "a small flight", "--from", "2026-01-01"]
    approved = aerocal("registry", "approve", "1", *at, *although)
    assert approved.returncode == 0, approved.stderr
    return found.directory, folder / "registry.sqlite"


def used(
    flights: tuple[Path, Path], registered: tuple[Path, Path], out: Path, monkeypatch: pytest.MonkeyPatch,
    *overrides: str,
) -> RunOutcome:  # fmt: skip
    monkeypatch.setenv("AEROCAL_REGISTRY", str(registered[1]))
    return carry_out(adjustment_alone, RunRequest(flights[1], out, overrides=(*_RIG, *overrides)))


def test_one_record_has_all_heads_with_their_joint_covariance(registered: tuple[Path, Path]) -> None:
    folder = registered[0]
    assert [file.name for file in folder.glob("calibration*.json")] == ["calibration.json"]
    assert [file.name for file in folder.glob("certificate*.json")] == ["certificate.json"]
    record = json.loads((folder / "calibration.json").read_text())
    certificate = json.loads((folder / "certificate.json").read_text())
    (brief,) = (section for section in certificate["sections"] if section["name"] == "brief")
    labels = [fact["label"] for fact in brief["blocks"][0]["facts"]]
    assert len(set(labels)) == len(labels)
    assert any(label.endswith("(left)") for label in labels)
    assert record["camera"]["name"] == "nadir"
    assert sorted(head["name"] for head in record["heads"]) == _HEADS
    estimated = [item for item in record["parameters"] if item["sigma"] is not None]
    assert {item["entity"] for item in estimated} >= {"nadir", *_HEADS}
    matrix = np.array(record["covariance"])
    rolls = [
        k
        for k, item in enumerate(estimated)
        if (item["parameter"], item["entity"])
        in (("relative_rotation_pitch", "left"), ("relative_rotation_pitch", "right"))
    ]
    pairs = pd.read_parquet(folder / "correlations.parquet")
    own = pairs[
        (pairs["parameter_a"] == "relative_rotation_pitch")
        & (pairs["parameter_b"] == "relative_rotation_pitch")
        & (pairs["entity_a"].isin(["left", "right"]) & pairs["entity_b"].isin(["left", "right"]))
    ]
    sigma = np.sqrt(np.diagonal(matrix))[rolls]
    assert matrix[rolls[0], rolls[1]] / sigma.prod() == pytest.approx(own["correlation"].iloc[0], abs=0.05)
    assert np.linalg.eigvalsh(matrix / np.sqrt(np.outer(*[np.diagonal(matrix)] * 2))).min() > 0.0


# Held values without their covariance: tests/flows/test_registered_calibration_use.py.
@pytest.mark.parametrize("use", ["consider", "prior", pytest.param("held", marks=pytest.mark.slow)])
def test_a_block_uses_values_and_covariance_of_all_heads(
    use: str,
    flights: tuple[Path, Path],
    registered: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    changes = (f'cameras.nadir.calibration_use="{use}"', "adjustment.free=[]")
    found = used(flights, registered, tmp_path / "out", monkeypatch, *changes)
    assert found.error is None, found.error
    keys = ["parameter", "entity"]
    before = pd.read_parquet(registered[0] / "parameters.parquet").set_index(keys)
    after = pd.read_parquet(found.directory / "parameters.parquet").set_index(keys)
    own = before[before["sigma"].notna() & (before["unit"] == "deg")].index
    own = own[own.get_level_values(0).str.startswith("relative_rotation")]
    assert len(own) == 12
    given = after.loc[own, "value"] - after.loc[own, "change"]
    np.testing.assert_allclose(given, before.loc[own, "value"], atol=1e-12)
    assert set(after.loc[own, "status"]) != {"eliminated"}
    (test,) = json.loads((found.directory / "summary.json").read_text())["registered_calibrations"] or (None,)
    if use == "held":
        assert test is None
        return
    assert test["parameters"] > 12
    assert test["probability"] > 1e-3
    if use == "prior":
        record = json.loads((registered[0] / "calibration.json").read_text())
        known = {(i["parameter"], i["entity"]): i["sigma"] for i in record["parameters"] if i["sigma"]}
        sigma = np.array([known[key] for key in own])
        assert np.all(after.loc[own, "sigma"] < sigma)
        truth = pd.read_parquet(flights[1].parent / "truth" / "parameters.parquet").set_index(keys)["value"]
        ratio = (after.loc[own, "value"] - truth.loc[own]) / after.loc[own, "sigma"]
        assert np.abs(ratio).max() < 4.0


def test_heads_are_calibrated_first_and_then_the_rig(
    flights: tuple[Path, Path], registered: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The focal length of one head is known before, and its error is part of the σ of the rig."""
    together = CalibrationRecord.model_validate_json((registered[0] / "calibration.json").read_text())
    (head,) = (one for one in together.heads if one.name == "left")
    (length,) = (i for i in together.parameters if i.key == ("focal_length", "left"))
    known = length.model_copy(update={"sigma": 0.01})
    alone = together.model_copy(
        update={"camera": head, "heads": (), "parameters": (known,), "covariance": ((0.01**2,),)}
    )
    alone = CalibrationRecord.model_validate(alone.model_dump() | {"verdict": together.verdict})
    address = registry_address(str(tmp_path / "heads.sqlite"))
    registry, signature = Registry.at(address), Signature("A. Engineer")
    stored = registry.add(SealedRecord.of(alone), signature)
    validity = Validity(date(2026, 1, 1), None)
    approval = approval_of(registry.contents(), str(stored.id), validity, "a small flight")
    registry.approve(approval, signature, "a small flight")
    monkeypatch.setenv("AEROCAL_REGISTRY", str(tmp_path / "heads.sqlite"))
    free = 'calibration.free=["boresight", "relative_rotation", "synchronisation_offset"]'
    overrides = (_DAY, free, 'cameras.left.calibration="registry"')
    found = carry_out(calibration_alone, RunRequest(flights[1], tmp_path / "out", overrides=overrides))
    assert found.error is None, found.error
    keys = ["parameter", "entity"]
    table = pd.read_parquet(found.directory / "parameters.parquet").set_index(keys)
    assert table.loc[("focal_length", "left"), "status"] == "considered"
    assert table.loc[("focal_length", "left"), "value"] == length.value
    assert table.loc[("focal_length", "right"), "status"] == "fixed"
    sigma = table["sigma"].loc[["relative_rotation_roll", "relative_rotation_pitch"]]
    assert sigma.xs("left", level="entity").max() > 1.05 * sigma.xs("right", level="entity").max()


def test_heads_of_another_rig_or_a_camera_alone_are_refused(
    flights: tuple[Path, Path], registered: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = 'cameras.left.identity.lens="L-77"'
    found = used(flights, registered, tmp_path / "other", monkeypatch, other)
    assert found.error is not None
    assert "has no approved calibration of nadir with 4 heads" in str(found.error)
    monkeypatch.setenv("AEROCAL_REGISTRY", str(registered[1]))
    alone = RunRequest(
        flights[1], tmp_path / "alone", overrides=(_DAY, 'cameras.left.calibration="registry"')
    )
    error = carry_out(adjustment_alone, alone).error
    assert error is not None
    assert "has no approved calibration of left" in str(error)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (('cameras.nadir.identity.band="PAN"',), "of band PAN, which the calibration does not declare"),
        (('cameras.nadir.identity.software="5.1"',), "of software version 5.1, which the calibration"),
        (('cameras.nadir.identity.product="camera_head"',), "of a virtual image, and this is a camera head"),
    ],
)
def test_another_band_software_or_product_is_refused(
    overrides: tuple[str, ...],
    message: str,
    flights: tuple[Path, Path],
    registered: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = used(flights, registered, tmp_path / "out", monkeypatch, *overrides)
    assert found.error is not None
    assert message in str(found.error)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (('cameras.left.calibration="registry-rig"',), "this one is not the reference head"),
        (
            ('cameras.nadir.calibration="registry-rig"', 'cameras.left.calibration="registry"'),
            "includes left, which also has a calibration of its own",
        ),
    ],
)
def test_two_calibrations_of_one_head_are_refused(
    override: tuple[str, ...], message: str, flights: tuple[Path, Path]
) -> None:
    with pytest.raises(InputError, match=message):
        load_project(flights[1], override)
