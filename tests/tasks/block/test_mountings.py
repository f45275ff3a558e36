"""Mountings of the cameras: their nominal part is computed once, whatever boresights are tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from adjust.camera import interior
from adjust.camera.interior import FrameCamera
from tasks.block.given_orientations import Mountings


def test_nominal_mountings_are_computed_once_for_all_boresights(monkeypatch: pytest.MonkeyPatch) -> None:
    nominal: Callable[[int], object] = interior.nominal_mounting
    counted = Mock(side_effect=nominal)
    monkeypatch.setattr(interior, "nominal_mounting", counted)
    cameras = tuple(
        FrameCamera(f"{turn}", 100, 80, 1e-5, 0.1, (0.0, 0.0), "corner", turn) for turn in (0, 90, 270)
    )
    none = np.zeros((3, 3))
    mountings = Mountings(cameras, none, none, none, np.arange(3), none, none, none[:, :1])
    tried = [replace(mountings, boresight=none + roll) for roll in np.radians((0.0, 1.0, 2.0))]
    stacked = [mountings.body_from_camera for mountings in tried for _ in range(2)]
    assert counted.call_count == len(cameras)
    assert all(np.array_equal(one, [nominal(camera.mount_deg) for camera in cameras]) for one in stacked)
    assert stacked[0] is stacked[1]
