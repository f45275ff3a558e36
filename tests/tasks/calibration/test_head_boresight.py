"""Boresight of heads: the product of two rotations, with the errors of both."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.geometry import rotation
from tasks.calibration.camera_record import rows_of
from tasks.calibration.head_boresight import head_boresights

_AXES = ("roll", "pitch", "yaw")
CAMERAS = pd.DataFrame({"camera": ["nadir", "left"], "head_of": [None, "nadir"]})


def table(boresight: Floats, relative: Floats, sigmas: Floats) -> pd.DataFrame:
    """Parameters of two cameras; the given boresight of the head stands there, too."""
    rows = [
        (f"{name}_{axis}", camera, camera, value, sigma)
        for name, camera, values, own in (
            ("boresight", "nadir", boresight, sigmas[:3]),
            ("relative_rotation", "left", relative, sigmas[3:]),
            ("boresight", "left", np.array([45.0, 0.0, 0.0]), np.full(3, np.nan)),
        )
        for axis, value, sigma in zip(_AXES, values, own, strict=True)
    ]
    return pd.DataFrame(rows, columns=["parameter", "entity", "camera", "value", "sigma"])


def correlations(parameters: pd.DataFrame, matrix: Floats) -> pd.DataFrame:
    keys = list(zip(parameters["parameter"][:6], parameters["entity"][:6], strict=True))
    rows = [(*keys[i], *keys[j], matrix[i, j]) for i in range(6) for j in range(i)]
    return pd.DataFrame(rows, columns=["parameter_a", "entity_a", "parameter_b", "entity_b", "correlation"])


def test_the_boresight_of_a_head_has_the_errors_of_both_rotations() -> None:
    random = np.random.default_rng(1)
    boresight, relative = np.array([0.02, -0.013, 0.034]), np.array([45.012, -0.021, 0.017])
    root = random.normal(size=(6, 6)) * 1e-3
    covariance = root @ root.T
    sigma = np.sqrt(np.diagonal(covariance))
    parameters = table(boresight, relative, sigma)
    pairs = correlations(parameters, covariance / np.outer(sigma, sigma))
    found = head_boresights(parameters, pairs, CAMERAS)["left"]

    def product(values: Floats) -> Floats:
        one, other = rotation.from_roll_pitch_yaw(np.deg2rad(values.reshape(-1, 2, 3))).swapaxes(0, 1)
        return np.rad2deg(rotation.to_heading_pitch_roll(one @ other)[:, ::-1])

    middle = np.concatenate([boresight, relative])
    np.testing.assert_allclose(found.angles, product(middle[None])[0], atol=1e-12)
    drawn = product(middle + random.normal(size=(40_000, 6)) @ root.T)
    np.testing.assert_allclose(found.sigma, drawn.std(axis=0), rtol=0.02)
    assert found.reference == "nadir"
    assert f"roll {found.angles[0]:.5f}°" in found.sentence("left")


def test_a_head_without_images_has_none() -> None:
    parameters = table(np.zeros(3), np.zeros(3), np.full(6, 1e-3))
    cameras = pd.concat([CAMERAS, pd.DataFrame({"camera": ["right"], "head_of": ["nadir"]})])
    assert set(head_boresights(parameters, correlations(parameters, np.eye(6)), cameras)) == {"left"}


def test_what_is_held_has_no_error_and_nothing_of_the_reference_head_is_listed() -> None:
    sigma = np.array([np.nan, np.nan, np.nan, 1e-3, 2e-3, 3e-3])
    parameters = table(np.zeros(3), np.zeros(3), sigma)
    found = head_boresights(parameters, correlations(parameters, np.eye(6)), CAMERAS)["left"]
    np.testing.assert_allclose(found.sigma, sigma[3:], rtol=1e-9)
    own = rows_of(parameters, ("nadir", "left"))
    assert list(own.loc[own["camera"] == "left", "parameter"]) == [f"relative_rotation_{a}" for a in _AXES]
    assert list(own.loc[own["camera"] == "nadir", "parameter"]) == [f"boresight_{axis}" for axis in _AXES]
