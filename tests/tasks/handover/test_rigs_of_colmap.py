"""Heads of a rig as COLMAP has them: poses of rig and heads together are those of the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.formats.colmap import read_colmap_exposures
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.handover.block_points import no_points
from tasks.handover.formats.register import REGISTER
from tasks.handover.rig_heads import rig_heads
from tests.tasks.handover.flown_block import NAMES, Flight, delivered, flown


def rig_block(turned=0.0):
    """Two events of two heads; the second head sits otherwise in the second event by `turned` radians."""
    results, _ = flown(Flight(2000.0, rig=True))
    turn = results.images.local_from_camera.copy()
    turn[3] = turn[3] @ from_omega_phi_kappa(np.array([turned, 0.0, 0.0]))
    return replace(results, images=replace(results.images, local_from_camera=turn))


def pose_of(values):
    """Rotation and translation of w, x, y, z, t."""
    w, x, y, z, *shift = map(float, values)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return turn, np.array(shift)


def test_rig_and_heads_make_the_poses_of_the_images():
    results = rig_block()
    files = REGISTER["colmap"].write(delivered(results, no_points(), "colmap"))
    (rig,) = [line.split() for line in files["rigs.txt"].splitlines() if line[0] != "#"]
    assert rig[:4] == ["1", "2", "CAMERA", "1"]
    assert rig[4:7] == ["CAMERA", "2", "1"]
    turn, shift = pose_of(rig[7:])
    frames = [line.split() for line in files["frames.txt"].splitlines() if line[0] != "#"]
    assert [frame[9:] for frame in frames] == [
        ["2", "CAMERA", "1", "1", "CAMERA", "2", "2"], ["2", "CAMERA", "1", "3", "CAMERA", "2", "4"],
    ]  # fmt: skip
    lines = [line.split() for line in files["images.txt"].splitlines() if line and line[0] != "#"]
    poses = [pose_of(line[1:8]) for line in lines]
    for k, frame in enumerate(frames):
        of_rig, place = pose_of(frame[2:9])
        for image, (head, beside) in ((2 * k, (np.eye(3), np.zeros(3))), (2 * k + 1, (turn, shift))):
            np.testing.assert_allclose(head @ of_rig, poses[image][0], atol=1e-13)
            np.testing.assert_allclose(head @ place + beside, poses[image][1], atol=1e-9)


def test_heads_that_move_against_each_other_are_no_rig_of_colmap():
    files = REGISTER["colmap"].write(delivered(rig_block(turned=1e-5), no_points(), "colmap"))
    assert not {"rigs.txt", "frames.txt"} & set(files)


def test_single_cameras_have_no_rigs():
    results, points = flown(Flight())
    assert not {"rigs.txt", "frames.txt"} & set(
        REGISTER["colmap"].write(delivered(results, points, "colmap"))
    )


def test_pycolmap_has_the_rig_and_its_frames(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    results = rig_block()
    for name, content in REGISTER["colmap"].write(delivered(results, no_points(), "colmap")).items():
        (tmp_path / name).write_text(content)
    found = pycolmap.Reconstruction(str(tmp_path))
    assert (len(found.rigs), len(found.frames), found.num_reg_images()) == (1, 2, 4)
    exposures = read_colmap_exposures(tmp_path / "images.txt", "omega-phi-kappa")
    names = exposures.image.to_pylist()
    for image in found.images.values():
        place = exposures.position[names.index(image.name)]
        np.testing.assert_allclose(image.projection_center(), place, atol=1e-8)


def test_the_binary_model_of_pycolmap_has_the_rig_that_was_written(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    results = rig_block()
    for name, content in REGISTER["colmap"].write(delivered(results, no_points(), "colmap")).items():
        (tmp_path / name).write_text(content)
    binary = tmp_path / "binary"
    binary.mkdir()
    pycolmap.Reconstruction(str(tmp_path)).write_binary(str(binary))
    ours, theirs = (
        read_colmap_exposures(
            folder / f"images.{ending}", "omega-phi-kappa", colmap_rig_files(folder / f"images.{ending}")
        )
        for folder, ending in ((tmp_path, "txt"), (binary, "bin"))
    )
    assert ours.heads.keys() == theirs.heads.keys() == {"2"}
    np.testing.assert_allclose(theirs.heads["2"].rotation, ours.heads["2"].rotation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(theirs.heads["2"].position, ours.heads["2"].position, rtol=0, atol=1e-9)
    assert dict(zip(theirs.image.to_pylist(), theirs.event.to_pylist(), strict=True)) == dict(
        zip(ours.image.to_pylist(), ours.event.to_pylist(), strict=True)
    )


def test_heads_are_joined_by_times_or_delivered_events():
    cameras = pd.DataFrame({"camera": ["A", "B", "C"], "head_of": [None, "A", None]})
    exposures = pd.DataFrame(
        {
            "image": NAMES, "camera": ["A", "B", "A", "C"], "flight": None,
            "time_s": [1.0, 1.0005, 2.0, 2.0], "event": None,
        }
    )  # fmt: skip
    heads = rig_heads(exposures, cameras, list(NAMES))
    assert heads is not None
    assert heads.reference.tolist() == [0, 0, 2]
    assert heads.event[0] == heads.event[1]
    assert len(set(heads.event.tolist())) == 3
    assert rig_heads(exposures, cameras.assign(head_of=None), list(NAMES)) is None
