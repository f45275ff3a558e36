"""The covariance of adjusted orientations: what a random error of the solution does to their elements."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.geometry import rotation
from adjust.handover.refit import Freed
from tasks.coordinates.local_frame import local_from_grid, map_from_local
from tasks.evaluation.result_tables import AdjustedBlock, write_exterior_orientations
from tasks.handover.delivery import Angles, Delivery
from tasks.handover.formats.eo_csv import write_eo_csv
from tasks.handover.receiver import hand_over
from tasks.store.artifact import artifact_of
from tasks.tables.parquet import read_table
from tests.tasks.evaluation.test_residual_table import adjusted_block
from tests.tasks.handover.flown_block import Flight, flown

ELEMENTS = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")
PAIRS = [
    (f"correlation_{one.split('_')[0]}_{other.split('_')[0]}", one, other)
    for one, other in combinations(ELEMENTS, 2)
]
TRIALS = 40_000


@pytest.fixture(scope="module")
def adjusted() -> AdjustedBlock:
    return adjusted_block(pd.DataFrame(columns=["image", "point", "sigma_x_mm", "sigma_y_mm"]))


def test_correlations_are_those_of_disturbed_solutions(adjusted: AdjustedBlock, tmp_path: Path) -> None:
    write_exterior_orientations(tmp_path, adjusted)
    table = read_table(artifact_of(tmp_path / "exterior_orientations.parquet")).set_index("image")
    state, cofactor = adjusted.result.state, adjusted.cofactor.reduced.of_exposures
    rng = np.random.default_rng(3)
    largest = 0.0
    for k in (0, 7):
        row = table.loc[adjusted.block.images[k]]
        error = rng.multivariate_normal(np.zeros(6), cofactor[k], TRIALS, method="cholesky")
        centre = state.projection_centre[k] + error[:, :3]
        turn = state.local_from_camera[k] @ rotation.exp(error[:, 3:])
        in_map = map_from_local(adjusted.map_frame, adjusted.frame, centre)
        axes = local_from_grid(adjusted.map_frame, adjusted.frame, in_map)
        angles = np.degrees(rotation.to_omega_phi_kappa(np.swapaxes(axes, 1, 2) @ turn))
        found = np.column_stack([in_map, np.unwrap(angles, period=360.0, axis=0)])
        expected = np.corrcoef(found.T)
        for name, one, other in PAIRS:
            i, j = ELEMENTS.index(one), ELEMENTS.index(other)
            # Four standard deviations of a correlation of so many trials.
            assert abs(row[name] - expected[i, j]) < 4.0 / np.sqrt(TRIALS)
            largest = max(largest, abs(row[name]))
        sigma = row[[f"sigma_{name}" for name in ELEMENTS]].to_numpy(np.float64)
        np.testing.assert_allclose(found.std(axis=0), sigma, rtol=0.03)
    assert largest > 0.15


@pytest.mark.parametrize(("order", "written"), [("omega-phi-kappa", 15), ("phi-omega-kappa", 3)])
def test_a_table_of_orientations_has_them_in_the_system_they_are_known_in(order: str, written: int) -> None:
    results, _ = flown(Flight())
    known = {name: np.linspace(-0.9, 0.9, len(results.images.names)) for name, _, _ in PAIRS}
    results = replace(results, orientations=results.orientations.assign(**known))
    delivery = Delivery(results, hand_over(results, "map", Freed()), Angles(order, "deg"))
    header, *rows = write_eo_csv(delivery)["eo.csv"].splitlines()
    names = [name for name in header.split(",") if name.startswith("correlation_")]
    assert len(names) == written
    assert rows[0].split(",")[-written:] == ["-0.900000"] * written
