"""A rig in every format that has rigs, and read again: the same heads, events and orientations.

A format joins by stating what it has of rigs; all others say that heads stand alone in them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa, from_roll_pitch_yaw
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.plain_records import CV_AXES
from tasks.formats.records import ExposureRecords, HeadRecord
from tasks.formats.register import read_exposures
from tasks.formats.rigs import declared_head
from tasks.formats.table_layout import TableLayout
from tasks.handover.formats.register import REGISTER
from tasks.handover.results import Results
from tasks.handover.rig_heads import RigHeads
from tasks.handover.statement import statement
from tests.tasks.formats.packed_files import packed
from tests.tasks.handover.flown_block import BESIDE, HEAD, NAMES, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import poses

#: Format → reader and its file.
READ = {
    "colmap": ("colmap", "images.txt"),
    "opensfm": ("opensfm", "reconstruction.json"),
    "opf": ("opf", "block.zip"),
    "metashape-xml": ("metashape", "metashape_cameras.xml"),
}
RELATIVE = CV_AXES @ HEAD @ CV_AXES


def written(results: Results, name: str, folder: Path) -> ExposureRecords:
    """A block in a format, as it is read again."""
    files = REGISTER[name].write(delivered(results, flown(Flight(rig=True))[1], name))
    for file, content in files.items():
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "block.zip").write_bytes(packed(files))
    reader, file = READ[name]
    rigs = colmap_rig_files(folder / file) if reader == "colmap" else None
    return read_exposures(reader, folder / file, "omega-phi-kappa", TableLayout(), rigs)


def events(records: ExposureRecords) -> dict[str, set[str]]:
    """Images by their events, those without an event by themselves."""
    assert records.event is not None
    found: dict[str, set[str]] = {}
    for image, event in zip(records.image.to_pylist(), records.event.to_pylist(), strict=True):
        found.setdefault(event or image, set()).add(image.replace("_a", " a"))
    return found


def test_every_format_with_rigs_is_read_again() -> None:
    assert set(READ) == {name for name, form in REGISTER.items() if form.rigs != "none"}


@pytest.mark.parametrize("name", READ)
def test_heads_and_events_come_back(name: str, tmp_path: Path) -> None:
    results = flown(Flight(rig=True))[0]
    records = written(results, name, tmp_path)
    ((name_of_head, head),) = records.heads.items()
    names = dict(zip(records.image.to_pylist(), records.camera.to_pylist(), strict=True))
    assert names["4"] == name_of_head
    assert names["III_3"] == head.reference
    np.testing.assert_allclose(head.rotation, RELATIVE, rtol=0, atol=1e-9)
    np.testing.assert_allclose(head.position, CV_AXES @ BESIDE, rtol=0, atol=1e-7)
    # So it is declared: mounting = R(ρ) T, body axes x right, y down, z forward.
    angles = declared_head(head)["rotation_deg"]
    turn = from_roll_pitch_yaw(np.deg2rad(np.array(angles, dtype=np.float64)))
    np.testing.assert_allclose(turn, RELATIVE, rtol=0, atol=1e-9)
    assert sorted(map(sorted, events(records).values())) == [["0002.tif", "1 a.tif"], ["4", "III_3"]]
    centre, turn = poses(results, records)
    listed = [image.replace("_a", " a") for image in records.image.to_pylist()]
    order = [listed.index(one) for one in NAMES]
    np.testing.assert_allclose(centre[order], results.images.projection_centre, rtol=0, atol=1e-7)
    np.testing.assert_allclose(turn[order], results.images.local_from_camera, rtol=0, atol=1e-9)


@pytest.mark.parametrize("pitch", [90.0, -90.0, 90.0 - 1e-6, -90.0 + 1e-8, 45.0])
def test_a_head_at_right_angles_is_declared_as_it_is(pitch: float) -> None:
    turn = from_roll_pitch_yaw(np.radians([20.0, pitch, -35.0]))
    declared = declared_head(HeadRecord("A", turn, np.zeros(3)))["rotation_deg"]
    again = from_roll_pitch_yaw(np.deg2rad(np.array(declared, dtype=np.float64)))
    np.testing.assert_allclose(again, turn, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", READ)
def test_an_event_without_its_reference_head(name: str, tmp_path: Path) -> None:
    """The third image is of another event, of which no other image is left."""
    results = flown(Flight(rig=True))[0]
    results = replace(results, heads=RigHeads(np.array([0, 0]), np.array([0, 0, 1, 2])))
    records = written(results, name, tmp_path)
    assert set(records.heads) == {records.camera.to_pylist()[NAMES.index("4")]}
    assert sorted(map(sorted, events(records).values())) == [["0002.tif", "1 a.tif"], ["4"], ["III_3"]]
    text = " ".join(statement(delivered(results, flown(Flight())[1], name), REGISTER[name]).split())
    assert "Rigs: 2 heads, 3 events." in text
    assert ("written as single images: 1." in text) == (REGISTER[name].rigs == "with-reference")


@pytest.mark.parametrize("name", READ)
def test_heads_that_move_are_cameras_alone(name: str, tmp_path: Path) -> None:
    results = flown(Flight(rig=True))[0]
    turn = results.images.local_from_camera.copy()
    turn[3] = turn[3] @ from_omega_phi_kappa(np.array([1e-5, 0.0, 0.0]))
    results = replace(results, images=replace(results.images, local_from_camera=turn))
    records = written(results, name, tmp_path)
    assert (records.heads, records.event) == ({}, None)
    text = statement(delivered(results, flown(Flight())[1], name), REGISTER[name])
    assert "written as single cameras: their pose relative" in " ".join(text.split())


@pytest.mark.parametrize("name", REGISTER)
def test_other_formats_say_that_heads_stand_alone(name: str) -> None:
    form = REGISTER[name]
    # Grids of correction polynomials are coarse, those of a forward distortion take seconds.
    results, points = flown(Flight(rig=True, corrections=form.grid))
    text = " ".join(statement(delivered(results, points, name), form).split())
    assert ("Heads of rigs are written as single cameras: the format has no rigs" in text) == (
        form.rigs == "none" and form.oriented
    )
    assert ("Rigs: 2 heads, 2 events." in text) == (form.rigs != "none")
