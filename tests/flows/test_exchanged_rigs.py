"""A penta camera in every exchange format that has rigs, adjusted again from there: the same result.

Events are observed once in both adjustments, and all mountings are held.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adjust.geometry.rotation import from_roll_pitch_yaw
from flows.stories.block_conversion import converted_block
from flows.stories.block_preparation import prepare_block
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame
from tasks.handover.formats.exchange import EXCHANGE
from tasks.inventory.folder import begin_project
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.store.store import Store
from tasks.tables.parquet import read_table
from tests.flows.test_exchanged_again import Original, adjust, project_of

_HEADS = 4
#: Six events; everything that is not adjusted is as it is given, and all axes are observed alike.
FLIGHT = (
    "project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=11.5",
    "project.angles=omega-phi-kappa", "flight.lines=2", "flight.exposures=3", "points.count=150",
    "noise.ins_deg=[0.003,0.003,0.003]", "truth.boresight_deg=[0,0,0]",
    *(f"head.{k}.rotation_change_deg=[0,0,0]" for k in range(_HEADS)),
    *(f"head.{k}.synchronisation_offset_change_s=0" for k in range(_HEADS)),
)  # fmt: skip
SIGMA_MM, PIXEL_MM, LONGER = 0.0012, 0.0052, 20010
SIGMA = {"colmap": SIGMA_MM / PIXEL_MM, "opf": SIGMA_MM / PIXEL_MM, "opensfm": SIGMA_MM / PIXEL_MM / LONGER}
WITH_CONTROL = {"opf"}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Original:
    folder = tmp_path_factory.mktemp("rig")
    file = simulate_project(load_simulation("penta", FLIGHT, 3), folder / "b").project_file
    project = load_project(
        file, ("adjustment.free=[]", "adjustment.refraction=none", "project.flown=2026-05-24")
    )
    store = Store.of(folder / "original")
    store.begin_run()
    block = prepare_block(project, store)
    positions = read_table(block.exposures["exposures"])[["x_m", "y_m", "z_m"]].to_numpy(float)
    place = MapFrame.of(project.project.crs, project.project.heights)
    return Original(project, store, block, local_frame(place, positions))


def test_every_exchange_format_with_rigs_is_adjusted_again() -> None:
    assert set(SIGMA) == {name for name, form in EXCHANGE.items() if form.rigs != "none"}


def _same_mountings(original: Original, declared: dict[str, Any]) -> None:
    """COLMAP has numbers in the place of names, which are in ascending order."""
    cameras = dict(sorted(original.project.cameras.items()))
    names = dict(zip(cameras, declared, strict=True))
    for camera, given in cameras.items():
        if given.head is None:
            assert "head" not in declared[names[camera]]
            continue
        head = declared[names[camera]]["head"]
        assert head["reference"] == names[given.head.reference]
        found, known = (
            from_roll_pitch_yaw(np.deg2rad(np.array(one)))
            for one in (head["rotation_deg"], given.head.rotation_deg)
        )
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-9)
        np.testing.assert_allclose(head["position_m"], given.head.position_m, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", SIGMA)
def test_an_exchanged_rig_has_the_same_result(name: str, original: Original, tmp_path: Path) -> None:
    out = tmp_path / "out"
    written, _ = converted_block(original.project, original.store, name, out, None)
    assert "Rigs: 5 heads, 6 events." in " ".join(written.statement.split())
    file = project_of(name, out)
    declared = tomllib.loads(file.read_text())["cameras"]
    _same_mountings(original, declared)
    settings = (
        f"inputs.image_points.sigma={SIGMA[name]!r}", "inputs.exposures.sigma.position_m=0.05",
        "inputs.exposures.sigma.attitude_deg=0.003", "adjustment.free=[]", "adjustment.rejection=none",
        "adjustment.refraction=none",
    )  # fmt: skip
    project = load_project(file, settings)
    store = Store.of(tmp_path / "again")
    store.begin_run()
    again = adjust(project, store, prepare_block(project, store), original.frame)
    first = original.adjusted(name in WITH_CONTROL)
    assert (again.names, again.image_points) == (first.names, first.image_points)
    assert len(again.names) == 30
    np.testing.assert_allclose(again.centre, first.centre, rtol=0, atol=2e-4)
    np.testing.assert_allclose(again.turn, first.turn, rtol=0, atol=2e-7)
    assert again.sigma0 == pytest.approx(first.sigma0, rel=1e-4)


def test_init_declares_the_heads_of_a_colmap_model(original: Original, tmp_path: Path) -> None:
    out = tmp_path / "model"
    converted_block(original.project, original.store, "colmap", out, None)
    found = begin_project(out)
    content = tomllib.loads(found.project_file.read_text())
    assert content["inputs"]["exposures"][0]["rigs"] == ["rigs.txt", "frames.txt"]
    heads = [camera.get("head") for camera in content["cameras"].values()]
    assert sum(head is None for head in heads) == 1
    _same_mountings(original, content["cameras"])
    remarks = {file.path.name: file.remark for file in found.files}
    assert remarks["rigs.txt"] == remarks["frames.txt"]
    assert remarks["rigs.txt"].startswith("rigs or frames of COLMAP")


def test_init_declares_the_heads_of_an_opensfm_reconstruction(original: Original, tmp_path: Path) -> None:
    out = tmp_path / "dataset"
    converted_block(original.project, original.store, "opensfm", out, None)
    found = begin_project(out)
    _same_mountings(original, tomllib.loads(found.project_file.read_text())["cameras"])
    remarks = {file.path.name: file.remark for file in found.files}
    assert remarks["rig_cameras.json"].startswith("cameras of OpenSfM's rigs")
    assert remarks["rig_assignments.json"].startswith("instances of OpenSfM's rigs")
