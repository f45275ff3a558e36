"""Rigs that are damaged: one clear message each, with the file, what is concerned, and what to do."""

from __future__ import annotations

import json
import struct
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from adjust.geometry.rotation import exp, from_omega_phi_kappa, log
from tasks.errors import InputError
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.records import ExposureRecords
from tasks.formats.register import CAMERA_FORMATS, read_exposures
from tasks.formats.table_layout import TableLayout
from tasks.handover.formats.register import REGISTER
from tests.tasks.formats.packed_files import packed
from tests.tasks.formats.test_fuzzing import Thrown, damage
from tests.tasks.handover.flown_block import Flight, delivered, flown
from tests.tasks.handover.test_exchanged_rigs import READ


def written(name: str, folder: Path, changed: Callable[[dict[str, str]], None]) -> Path:
    """The rig in a format, changed, and its file."""
    whole = dict(REGISTER[name].write(delivered(*flown(Flight(rig=True)), name)))
    text = {file: content for file, content in whole.items() if isinstance(content, str)}
    changed(text)
    files = {**whole, **text}
    for file, content in files.items():
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "block.zip").write_bytes(packed(files))
    return folder / READ[name][1]


def read(name: str, file: Path) -> ExposureRecords:
    rigs = colmap_rig_files(file) if name == "colmap" else None
    return read_exposures(READ[name][0], file, "omega-phi-kappa", TableLayout(), rigs)


def refused(name: str, folder: Path, changed: Callable[[dict[str, str]], None]) -> InputError:
    file = written(name, folder, changed)
    with pytest.raises(InputError) as caught:
        read(name, file)
    assert caught.value.file is not None
    assert caught.value.file.parent == folder
    assert caught.value.remedy
    return caught.value


def replaced(file: str, old: str, new: str) -> Callable[[dict[str, str]], None]:
    def change(files: dict[str, str]) -> None:
        assert old in files[file]
        files[file] = files[file].replace(old, new, 1)

    return change


def in_json(file: str, change: Callable[[dict], None]) -> Callable[[dict[str, str]], None]:
    def changed(files: dict[str, str]) -> None:
        content = json.loads(files[file])
        change(content[0] if isinstance(content, list) else content)
        files[file] = json.dumps([content[0]] if isinstance(content, list) else content)

    return changed


def in_xml(change: Callable[[ElementTree.Element], None]) -> Callable[[dict[str, str]], None]:
    def changed(files: dict[str, str]) -> None:
        root = ElementTree.fromstring(files["metashape_cameras.xml"])
        change(root)
        files["metashape_cameras.xml"] = ElementTree.tostring(root, encoding="unicode")

    return changed


def instance(content: dict, **shots: str) -> None:
    content["rig_instances"]["1"]["rig_camera_ids"] |= shots


MISSING = {
    "colmap": replaced("frames.txt", "CAMERA 2 2\n", "CAMERA 2 77\n"),
    "opensfm": in_json("reconstruction.json", lambda one: instance(one, lost="B")),
    "opf": in_json("camera-list.json", lambda one: one["cameras"].pop(1)),
}
TWO_IMAGES = {
    "colmap": replaced("frames.txt", "2 CAMERA 1 1 CAMERA 2 2\n", "3 CAMERA 1 1 CAMERA 2 2 CAMERA 2 4\n"),
    "opensfm": in_json("reconstruction.json", lambda one: instance(one, **{"4": "B"})),
    "opf": in_json(
        "input-cameras.json",
        lambda one: one["captures"][0]["cameras"].append(one["captures"][1]["cameras"].pop(1)),
    ),
    "metashape-xml": in_xml(lambda root: root.findall(".//camera")[3].set("master_id", "0")),
}
TWICE = {
    "colmap": replaced("rigs.txt", "\n1 2 CAMERA 1 ", "\n2 1 CAMERA 2\n1 2 CAMERA 1 "),
    "metashape-xml": in_xml(
        lambda root: root.find(".//sensors").append(root.findall(".//sensor")[1])  # type: ignore[union-attr]
    ),
}
WITHOUT_MASTER = {
    "colmap": replaced("rigs.txt", "\n1 2 CAMERA 1 ", "\n9 2 CAMERA 1 "),
    "opensfm": in_json("reconstruction.json", lambda one: one["rig_cameras"].pop("B")),
    "opf": in_json("input-cameras.json", lambda one: one["captures"][1].update(reference_camera_id=99)),
    "metashape-xml": in_xml(lambda root: root.findall(".//sensor")[1].set("master_id", "7")),
}


@pytest.mark.parametrize("name", MISSING)
def test_an_image_of_an_event_that_is_missing_is_named(name: str, tmp_path: Path) -> None:
    error = refused(name, tmp_path, MISSING[name])
    image = {"colmap": "77", "opensfm": "lost", "opf": "1"}[name]
    if name == "opf":
        assert "no camera or sensor 1" in error.what
    else:
        assert error.what == f"The event has the image '{image}', which is missing."
    assert error.entity


@pytest.mark.parametrize("name", TWO_IMAGES)
def test_two_images_of_one_head_in_an_event_are_named(name: str, tmp_path: Path) -> None:
    error = refused(name, tmp_path, TWO_IMAGES[name])
    assert error.what.startswith("The head '")
    assert error.what.endswith("' has two images of one event: '0002.tif' and '4'.")
    assert error.entity in ("frame 1", "instance 1", "capture 0", "1 a.tif")


@pytest.mark.parametrize("name", TWICE)
def test_a_head_that_is_declared_twice_is_named(name: str, tmp_path: Path) -> None:
    error = refused(name, tmp_path, TWICE[name])
    assert "is declared twice" in error.what
    assert error.entity in ("2", "B")


@pytest.mark.parametrize("name", WITHOUT_MASTER)
def test_a_head_without_its_rig_or_master_is_named(name: str, tmp_path: Path) -> None:
    error = refused(name, tmp_path, WITHOUT_MASTER[name])
    expected = {
        "colmap": "The image '1 a.tif' is of the head '1', which its rig does not have.",
        "opensfm": "The image '0002.tif' is of the head 'B', which its rig does not have.",
        "opf": "Its reference camera 99 is not among its cameras.",
        "metashape-xml": "Its master, the sensor 7, is not in the file.",
    }
    assert error.what.replace("1_a.tif", "1 a.tif") == expected[name]
    assert error.entity in ("frame 1", "instance 1", "capture 1", "sensor B")


def test_a_slave_camera_without_its_master_or_mounting_is_named(tmp_path: Path) -> None:
    lost = in_xml(lambda root: root.findall(".//camera")[1].set("master_id", "55"))
    assert refused("metashape-xml", tmp_path, lost).what == "Its master, the camera 55, is not in the file."

    def without_rotation(root: ElementTree.Element) -> None:
        sensor = root.findall(".//sensor")[1]
        sensor.remove(sensor.findall("rotation")[0])

    error = refused("metashape-xml", tmp_path, in_xml(without_rotation))
    assert error.what.startswith("The slave camera has no transform")
    assert error.entity == "0002.tif"


def test_a_rig_whose_mounting_is_not_stated_stands_alone(tmp_path: Path) -> None:
    def without_pose(files: dict[str, str]) -> None:
        line = files["rigs.txt"].splitlines()
        files["rigs.txt"] = "\n".join([line[0], " ".join([*line[1].split()[:6], "0"])]) + "\n"

    records = read("colmap", written("colmap", tmp_path, without_pose))
    assert (records.heads, set(records.event or []) - {None}) == ({}, set())
    assert records.remarks == (
        "The heads 1, 2 are read as single cameras: their mounting is not in the file.",
    )


def test_rigs_and_frames_of_colmap_in_binary_are_those_in_text(tmp_path: Path) -> None:
    file = written("colmap", tmp_path, lambda _: None)
    in_text = read("colmap", file)
    rigs, frames = (
        [line.split() for line in (tmp_path / f"{kind}.txt").read_text().splitlines() if line[0] != "#"]
        for kind in ("rigs", "frames")
    )
    (rig,) = rigs
    packed_rig = struct.pack("<QIIiI", 1, int(rig[0]), 2, 0, int(rig[3]))
    packed_rig += struct.pack("<iIB7d", 0, int(rig[5]), 1, *map(float, rig[7:]))
    packed_frames = struct.pack("<Q", len(frames))
    for one in frames:
        packed_frames += struct.pack("<II7dI", int(one[0]), int(one[1]), *map(float, one[2:9]), int(one[9]))
        for kind, sensor, image in (one[10:13], one[13:16]):
            assert kind == "CAMERA"
            packed_frames += struct.pack("<iIQ", 0, int(sensor), int(image))
    (tmp_path / "rigs.bin").write_bytes(packed_rig)
    (tmp_path / "frames.bin").write_bytes(packed_frames)
    binary = tmp_path / "rigs.bin", tmp_path / "frames.bin"
    records = read_exposures("colmap", file, "omega-phi-kappa", TableLayout(), binary)
    assert records.event == in_text.event
    np.testing.assert_array_equal(records.heads["2"].rotation, in_text.heads["2"].rotation)
    np.testing.assert_array_equal(records.heads["2"].position, in_text.heads["2"].position)
    binary[1].write_bytes(packed_frames[:-1])
    with pytest.raises(InputError, match=r"frames.bin:2: .*ends in the middle of an entry"):
        read_exposures("colmap", file, "omega-phi-kappa", TableLayout(), binary)


def test_heads_with_one_camera_model_have_a_camera_each(tmp_path: Path) -> None:
    """As of several cameras of the same make; the frame of the rig is none of them."""
    turn = from_omega_phi_kappa(np.array([0.1, -0.2, 0.3]))

    def change(one: dict) -> None:
        for shot in one["shots"].values():
            shot["camera"] = "UC A"
        for name in ("UC A", "B"):
            head = one["rig_cameras"].pop(name)
            head["rotation"] = log(exp(np.array(head["rotation"])) @ turn).tolist()
            one["rig_cameras"][f"head {name}"] = head
        for own in one["rig_instances"].values():
            shots = own["rig_camera_ids"]
            own["rig_camera_ids"] = {shot: f"head {head}" for shot, head in shots.items()}

    plain = read("opensfm", written("opensfm", tmp_path, lambda _: None))
    file = written("opensfm", tmp_path, in_json("reconstruction.json", change))
    records = read("opensfm", file)
    assert set(records.camera.to_pylist()) == {"head UC A", "head B"}
    head = records.heads["head B"]
    assert head.reference == "head UC A"
    np.testing.assert_allclose(head.rotation, plain.heads["B"].rotation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(head.position, plain.heads["B"].position, rtol=0, atol=1e-9)
    cameras = CAMERA_FORMATS["opensfm"](file)
    assert cameras["head UC A"] == cameras["head B"] == cameras["UC A"]


RIG_FILES = {
    "colmap": ("rigs.txt", "frames.txt"),
    "opensfm": ("reconstruction.json",),
    "opf": ("input-cameras.json", "calibrated-cameras.json"),
    "metashape-xml": ("metashape_cameras.xml",),
}


@pytest.mark.parametrize("name", RIG_FILES)
def test_damage_of_rigs_is_refused_or_read_but_never_a_crash(name: str, tmp_path: Path) -> None:
    few = in_json("reconstruction.json", lambda one: one["points"].clear())
    sound = written(name, tmp_path, few if name == "opensfm" else lambda _: None)
    content = {file: (tmp_path / file).read_bytes() for file in RIG_FILES[name]}
    whole = {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.suffix != ".zip"}
    chance, refusals = Thrown(19), 0
    for _ in range(300):
        changed = {file: damage(one, chance) for file, one in content.items()}
        for file, one in changed.items():
            (tmp_path / file).write_bytes(one)
        if name == "opf":
            sound.write_bytes(packed({**whole, **changed}))
        error, records = refusal_or_read(name, sound)
        refusals += error is not None
        if error is not None:
            assert error.what
            assert error.remedy
            assert len(str(error)) < 5_000
        elif records is not None:
            assert all(np.isfinite(head.rotation).all() for head in records.heads.values())
    assert refusals > 0


def refusal_or_read(name: str, file: Path) -> tuple[InputError | None, ExposureRecords | None]:
    try:
        return None, read(name, file)
    except InputError as error:
        return error, None
