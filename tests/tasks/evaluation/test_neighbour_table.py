"""Correlations of neighbouring images of an adjusted flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images with GNSS of high accuracy relative to a common shift that is free."""
    folder = tmp_path_factory.mktemp("flight")
    project = simulate_project(load_simulation("dmc-20cm", ("points.count=300",), 4), folder).project_file
    found = carry_out(adjustment_alone, RunRequest(project, folder / "results"))
    assert found.error is None, found.error
    return found.directory


def test_neighbours_follow_each_other_in_their_strips(results: Path) -> None:
    table = pd.read_parquet(results / "neighbouring_images.parquet")
    images = pd.read_parquet(results / "images.parquet").set_index("image")
    strips = images["strip"]
    assert (table["image"].map(strips) == table["next_image"].map(strips)).all()
    assert len(table) == len(images) - strips.nunique()
    assert not table.duplicated(["image"]).any()


def test_sigma_of_the_difference_follows_from_correlation_and_sigmas(results: Path) -> None:
    table = pd.read_parquet(results / "neighbouring_images.parquet")
    orientations = pd.read_parquet(results / "exterior_orientations.parquet").set_index("image")
    for axis in ("x", "y", "z", "omega", "phi", "kappa"):
        unit = "m" if axis in "xyz" else "deg"
        own, other = (
            table[name].map(orientations[f"sigma_{axis}_{unit}"]) for name in ("image", "next_image")
        )
        rho = table[f"rho_{axis}"]
        expected = np.sqrt(own**2 + other**2 - 2.0 * rho * own * other)
        np.testing.assert_allclose(table[f"sigma_d{axis}_{unit}"], expected, rtol=1e-8)
        assert rho.between(-1.0, 1.0).all()


def test_heights_of_neighbours_have_errors_in_common(results: Path) -> None:
    """Common image points tie the heights of neighbours; their positions in plan are held by GNSS of each."""
    table = pd.read_parquet(results / "neighbouring_images.parquet")
    assert table["rho_z"].median() > 0.3
    assert table["rho_z"].median() > table["rho_x"].median() + 0.2
