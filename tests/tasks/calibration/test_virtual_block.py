"""The block of virtual images against collinearity in closed form."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.camera.virtual_image import in_heads
from tasks.calibration.platform import AdjustedPlatform
from tasks.calibration.virtual_block import virtual_block
from tests.adjust.platform_scenes import dmc_heads

NAMES = ("PAN1", "PAN2", "PAN3", "PAN4")
HALF_FORMAT = np.array([0.04608, 0.082944])
DISTANCE = 2000.0


def platform() -> AdjustedPlatform:
    heads = dmc_heads()
    return AdjustedPlatform("virtual", NAMES, heads, heads, HALF_FORMAT, np.eye(12), DISTANCE)


def cameras() -> pd.DataFrame:
    return pd.DataFrame({"camera": ("virtual", *NAMES), "mount_deg": (0, 90, 90, 270, 270)})


def exposures() -> pd.DataFrame:
    """One event of four heads; κ belongs to the mounting of each."""
    kappa = [100.0, 100.0, -80.0, -80.0]
    return pd.DataFrame(
        {
            "image": [f"I_{name}" for name in NAMES],
            "camera": NAMES,
            "flight": "1",
            "event": None,
            "time_s": 5.0,
            "kappa_deg": kappa,
        }
    )


def image_points(virtual: np.ndarray) -> pd.DataFrame:
    """Where every head would see points of the virtual image, with 1 µm in x and 2 µm in y."""
    heads = dmc_heads()
    rows = []
    for number, name in enumerate(NAMES):
        xy = in_heads(heads, np.full(len(virtual), number), virtual, DISTANCE)
        for point, place in enumerate(xy):
            if (np.abs(place) <= heads.half_format[number]).all():
                rows.append((f"I_{name}", f"P{point}", *(place * 1e3), 1e-3, 2e-3, None))
    columns = ["image", "point", "x_mm", "y_mm", "sigma_x_mm", "sigma_y_mm", "input_file"]
    return pd.DataFrame(rows, columns=columns)


def test_points_of_the_ground_come_to_lie_where_the_virtual_image_has_them() -> None:
    places = np.random.default_rng(1).uniform(-0.95, 0.95, (200, 2)) * HALF_FORMAT
    measured = image_points(places)
    block = virtual_block(platform(), exposures(), cameras(), measured)
    found = block.image_points.sort_values("point", key=lambda names: names.str[1:].astype(int))
    assert len(found) == len(places)
    np.testing.assert_allclose(found[["x_mm", "y_mm"]].to_numpy(), places * 1e3, atol=1e-10)
    assert block.doubled == len(measured) - len(places) > 0
    assert block.outside == 0
    assert set(found["image"]) == {"I_PAN1"}


def test_standard_deviations_are_those_of_the_head_turned_into_the_virtual_image() -> None:
    places = np.array([[0.02, 0.04], [-0.03, -0.05]])
    block = virtual_block(platform(), exposures(), cameras(), image_points(places))
    sigma = block.image_points[["sigma_x_mm", "sigma_y_mm"]].to_numpy()
    # Heads stand across: their y, with 2 µm, is x of the virtual image.
    assert np.all(sigma[:, 0] > 1.5e-3)
    assert np.all(sigma[:, 1] < 1.5e-3)


def test_kappa_of_a_head_becomes_that_of_the_virtual_image() -> None:
    block = virtual_block(platform(), exposures(), cameras(), image_points(np.array([[0.02, 0.04]])))
    np.testing.assert_allclose(block.exposures["kappa_deg"], [10.0])
    assert block.exposures["camera"].tolist() == ["virtual"]
