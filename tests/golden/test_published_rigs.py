"""Statistics of a rig by dense algebra: heads have the poses of events, which GNSS and INS observe once.

Mounting and synchronisation offsets of the heads are estimated; formulas: docs/theory/adjustment.md.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from tests.golden import test_published_statistics as statistics
from tests.golden.delivered_block import ANGLES, DEGREE, PLACE, Array
from tests.golden.delivered_rig import DeliveredRig, dependence
from tests.golden.oracle import Oracle, computed, exactly, simulated

FLIGHT = (
    "points.count=60",
    "control.columns=5",
    "control.rows=4",
    "flight.name=E",
    "flight.heading_deg=90.0",
    "flight.lines=2",
    "flight.exposures=4",
    "flight.end_lap=0.6",
    'project.free=["boresight", "gnss_shift", "relative_rotation", "synchronisation_offset", "focal_length"]',
)
ELEMENTS = (*PLACE, *ANGLES)
UNITS = np.array([1.0, 1.0, 1.0, DEGREE, DEGREE, DEGREE])
CHECKS = (
    statistics.test_the_adjusted_values_are_at_the_minimum,
    statistics.test_residuals_and_their_statistics,
    statistics.test_groups,
    statistics.test_points_and_parameters,
    statistics.test_control_points,
    statistics.test_check_points,
    statistics.test_influences_of_observations_on_parameters,
    statistics.test_what_holds_the_datum,
    statistics.test_alternatives_of_the_model,
)


@pytest.fixture(scope="module")
def oracle(tmp_path_factory: pytest.TempPathFactory) -> Oracle:
    project = simulated(tmp_path_factory.mktemp("rig"), "penta", FLIGHT)
    return Oracle.of(project, computed(project), DeliveredRig)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__.removeprefix("test_"))
def test_statistics_of_the_block(oracle: Oracle, check: Callable[[Oracle], None]) -> None:
    check(oracle)


@pytest.fixture(scope="module")
def images(oracle: Oracle) -> pd.DataFrame:
    return oracle.results.table("exterior_orientations")


@pytest.fixture(scope="module")
def covariance(oracle: Oracle, images: pd.DataFrame) -> Array:
    """(6 n, 6 n) of all images of all heads, J Q Jᵀ in the units of the table."""
    assert isinstance(oracle.block, DeliveredRig)
    assert images["image"].map(oracle.block.camera_of_image).nunique() == 5
    dense = oracle.dense
    j = dependence(oracle.block, dense.x0, images, list(dense.columns)) / np.tile(UNITS, len(images))[:, None]
    return np.asarray(oracle.factor**2 * j @ dense.q @ j.T)


def test_orientations_of_heads(images: pd.DataFrame, covariance: Array) -> None:
    n = len(images)
    sigma = np.sqrt(np.diagonal(covariance)).reshape(n, 6)
    exactly(images[[f"sigma_{name}" for name in ELEMENTS]], sigma, "σ of orientations")
    every = 6 * np.arange(n)
    for i, j in combinations(range(6), 2):
        a, b = ELEMENTS[i].split("_")[0], ELEMENTS[j].split("_")[0]
        expected = covariance[every + i, every + j] / (sigma[:, i] * sigma[:, j])
        exactly(images[f"correlation_{a}_{b}"], expected, "correlation", of=np.ones(n))


def test_neighbouring_images(oracle: Oracle, images: pd.DataFrame, covariance: Array) -> None:
    pairs = oracle.results.table("neighbouring_images")
    assert len(pairs)
    place = {name: k for k, name in enumerate(images["image"])}
    sigma = np.sqrt(np.diagonal(covariance))
    for k, name in enumerate(ELEMENTS):
        i, j = (pairs[c].map(place).to_numpy() * 6 + k for c in ("image", "next_image"))
        axis, unit = name.split("_")
        exactly(pairs[f"rho_{axis}"], covariance[i, j] / (sigma[i] * sigma[j]), "ρ", of=np.ones(len(i)))
        variance = covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j]
        exactly(pairs[f"sigma_d{axis}_{unit}"], np.sqrt(variance), "σ of a difference")
