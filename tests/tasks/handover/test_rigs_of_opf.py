"""Rigs of OPF as pyopf has them: its sensors with relatives and its captures are our heads and events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.formats.plain_records import CV_AXES
from tasks.handover.formats.register import REGISTER
from tests.tasks.handover.flown_block import BESIDE, HEAD, Flight, delivered, flown


def test_pyopf_places_the_images_of_heads_by_their_captures(tmp_path: Path) -> None:
    io, resolve = pytest.importorskip("pyopf.io"), pytest.importorskip("pyopf.resolve")
    results, points = flown(Flight(rig=True))
    for name, content in REGISTER["opf"].write(delivered(results, points, "opf")).items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    project = resolve.resolve(io.load(str(tmp_path / "project.opf")))
    sensors = {sensor.id: sensor for sensor in project.calibration.calibrated_cameras.sensors}
    assert sensors[0].rig_relatives is None
    relative = sensors[1].rig_relatives
    turn = from_omega_phi_kappa(np.radians(np.array(relative.rotation_angles_deg, dtype=np.float64)))
    np.testing.assert_allclose(turn, CV_AXES @ HEAD @ CV_AXES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(relative.translation, CV_AXES @ BESIDE, rtol=0, atol=1e-7)
    cameras = {camera.id: camera for camera in project.calibration.calibrated_cameras.cameras}
    captures = project.input_cameras.captures
    assert [[int(camera.id) for camera in one.cameras] for one in captures] == [[0, 1], [2, 3]]
    for capture in captures:
        # The specification: T_s = T_r + R_r T_rel, in axes right, down, front of the reference camera.
        first, other = (cameras[camera.id] for camera in capture.cameras)
        assert first.id == capture.reference_camera_id
        angles = np.radians(np.array([first.orientation_deg, other.orientation_deg], dtype=np.float64))
        of_first, of_other = from_omega_phi_kappa(angles) @ CV_AXES
        np.testing.assert_allclose(of_first @ turn, of_other, rtol=0, atol=1e-9)
        place = np.array(first.position) + of_first @ np.array(relative.translation)
        np.testing.assert_allclose(place, np.array(other.position), rtol=0, atol=1e-7)
