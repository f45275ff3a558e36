"""What is said about the rough misalignment of camera and INS."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from tasks.plausibility.misalignment import Misalignment


def test_an_angle_that_rounds_to_zero_has_no_minus() -> None:
    mountings = SimpleNamespace(names=("A",), has_heads=False)
    angles = np.deg2rad([[-0.004, 0.5, -0.67]])
    found = Misalignment(SimpleNamespace(mountings=mountings), angles)  # type: ignore[arg-type]
    assert "camera A roll +0.00°, pitch +0.50°, yaw -0.67°" in found.sentence
