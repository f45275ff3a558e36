"""A rig whose mounting is considered, with the covariance of a registered calibration, by dense algebra.

Σ(x) = σ0² Q + K C Kᵀ, Σ(x, g) = −K C, Q_vv = (I − H) + B̃ C B̃ᵀ (Schmidt 1966); docs/theory/adjustment.md.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from scipy import stats

from tests.command_line import aerocal
from tests.flows.calibration_alone import calibration_alone
from tests.golden.delivered_block import ANGLES, DEGREE, PLACE, UNITS, Array
from tests.golden.delivered_rig import DeliveredRig, dependence
from tests.golden.oracle import DELTA0, Oracle, computed, exactly, simulated

FLIGHT = (
    "points.count=60",
    "control.columns=5",
    "control.rows=4",
    "flight.lines=2",
    "flight.exposures=4",
    "flight.end_lap=0.6",
)
DAY = "project.flown=2026-06-01"
FREE = 'calibration.free=["boresight", "relative_rotation", "focal_length", "synchronisation_offset"]'


@dataclass(frozen=True, eq=False)
class Considered:
    """A block with the record of its calibration, and the errors that come from it."""

    oracle: Oracle
    record: dict[str, Any]

    @cached_property
    def names(self) -> list[tuple[str, str]]:
        """Parameters with a covariance that the block has."""
        every = [(item["parameter"], item["entity"]) for item in self.estimated]
        return [name for name in every if name in self.oracle.block.number]

    @cached_property
    def estimated(self) -> list[dict[str, Any]]:
        return [item for item in self.record["parameters"] if item.get("sigma") is not None]

    @cached_property
    def covariance(self) -> Array:
        """C in SI."""
        own = [
            k for k, item in enumerate(self.estimated) if (item["parameter"], item["entity"]) in self.names
        ]
        unit = np.array([UNITS.get(self.estimated[k]["unit"], 1.0) for k in own])
        return np.array(self.record["covariance"])[np.ix_(own, own)] * np.outer(unit, unit)

    @cached_property
    def a(self) -> Array:
        """A_g of the considered parameters, over the scalars used."""
        d, first = self.oracle.dense, len(self.oracle.dense.x0) - len(self.oracle.block.g)
        columns = [d.derivative(first + self.oracle.block.number[name]) for name in self.names]
        return np.stack(columns, axis=1)[d.used]

    @cached_property
    def k(self) -> Array:
        d = self.oracle.dense
        return np.asarray(d.q @ (d.a.T @ d.p @ self.a))

    @cached_property
    def joint(self) -> Array:
        """Covariance of all unknowns and of the considered parameters."""
        moved = self.k @ self.covariance
        of_unknowns = self.oracle.factor**2 * self.oracle.dense.q + moved @ self.k.T
        return np.block([[of_unknowns, -moved], [-moved.T, self.covariance]])

    @cached_property
    def residual_errors(self) -> Array:
        """P B̃ C B̃ᵀ P."""
        d = self.oracle.dense
        b = d.p @ (self.a - d.a @ self.k)
        return np.asarray(b @ self.covariance @ b.T)


@pytest.fixture(scope="module")
def considered(tmp_path_factory: pytest.TempPathFactory) -> Considered:
    """The first flight calibrates the rig; the second one uses its calibration as it is approved."""
    folder = tmp_path_factory.mktemp("rigs")
    first, second = (simulated(folder / str(seed), "penta", FLIGHT, seed) for seed in (3, 4))
    found = computed(first, (FREE, DAY), calibration_alone)
    registry = folder / "registry.sqlite"
    at = ["--registry", str(registry), "--by", "A. Engineer"]
    assert aerocal("registry", "add", found.folder, *at).returncode == 0
    although = ["--although", "a small flight", "--from", "2026-01-01"]
    assert aerocal("registry", "approve", "1", *at, *although).returncode == 0
    settings = (DAY, 'cameras.nadir.calibration="registry-rig"', "adjustment.free=[]")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_REGISTRY", str(registry))
        used = computed(second, settings)
    record = json.loads((found.folder / "calibration.json").read_text())
    return Considered(Oracle.of(second, used, DeliveredRig), record)


def test_the_adjusted_values_are_at_the_minimum(considered: Considered) -> None:
    d = considered.oracle.dense
    b = -d.a.T @ d.p @ d.v
    assert np.sqrt(b @ d.q @ b) < 1e-4
    exactly(considered.oracle.results.summary["sigma0"], d.sigma0, "σ0")
    table = considered.oracle.results.table("parameters").set_index(["parameter", "entity"])
    own = table.loc[considered.names]
    assert len(own) > 20
    assert (own["status"] == "considered").all()
    unit = own["unit"].map(lambda name: UNITS.get(name, 1.0)).to_numpy()
    exactly(own["sigma"] * unit, np.sqrt(np.diagonal(considered.covariance)), "σ of considered parameters")


def test_residuals(considered: Considered) -> None:
    oracle, d = considered.oracle, considered.oracle.dense
    table = oracle.residuals
    unit = table["unit"].map(lambda name: UNITS.get(name, 1.0)).to_numpy()
    exactly(table["redundancy"], oracle.redundancy, "r", of=1.0)
    told = oracle.redundancy > 1e-4
    held = np.diagonal(oracle.scatter)
    of_error = np.sqrt(held + np.diagonal(considered.residual_errors))
    exactly(table["standardized"][told], (d.p @ d.v / of_error)[told], "w", of=1.0, tolerance=1e-6)
    # An error moves (P v)_i as with the parameters held, and is to exceed what both scatter it by.
    detectable = DELTA0 * of_error / held
    exactly((table["mdb"] * unit)[told], detectable[told], "∇₀")
    external = detectable * np.sqrt(np.maximum(np.diagonal(oracle.fitted), 0.0))
    exactly(table["external"][told], external[told], "δ̄")
    larger = np.diagonal(considered.residual_errors) / held
    assert larger[told].max() > 0.05  # it matters


def test_orientations_and_points(considered: Considered) -> None:
    oracle = considered.oracle
    images, points = oracle.results.table("exterior_orientations"), oracle.results.table("object_points")
    block = oracle.block
    assert isinstance(block, DeliveredRig)
    first = len(oracle.dense.x0) - len(block.g)
    columns = [*oracle.dense.columns, *(first + block.number[name] for name in considered.names)]
    j = dependence(block, oracle.dense.x0, images, columns)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", j, considered.joint, j)).reshape(-1, 6)
    sigma /= [1.0, 1.0, 1.0, DEGREE, DEGREE, DEGREE]
    exactly(images[[f"sigma_{name}" for name in (*PLACE, *ANGLES)]], sigma, "σ of orientations")
    own = np.sqrt(np.diagonal(considered.joint))[oracle.first_point : oracle.border].reshape(-1, 3)
    exactly(points[["sigma_x_m", "sigma_y_m", "sigma_z_m"]], own, "σ of points")
    alone = oracle.factor * oracle.spread[oracle.first_point : oracle.border].reshape(-1, 3)
    assert (own / alone).max() > 1.05  # it matters


def test_check_points(considered: Considered) -> None:
    oracle = considered.oracle
    table = oracle.results.table("check_points")
    at = oracle.first_point + 3 * np.array([oracle.block.point_number[name] for name in table["point"]])
    variance = np.diagonal(considered.joint)[at[:, None] + np.arange(3)]
    survey = oracle.block.survey_sigma.loc[table["point"]].to_numpy() ** 2
    exactly(table[["sigma_dx_m", "sigma_dy_m", "sigma_dz_m"]], np.sqrt(variance + survey), "σ of differences")
    for k in range(3):
        rows = at + k
        own = considered.joint[np.ix_(rows, rows)] + np.diag(survey[:, k])
        test = oracle.results.summary["check_point_test"]
        exactly(test["predicted_rmse_m"][k], np.sqrt(np.trace(own) / len(rows)), "predicted RMS")
        exactly(test["predicted_mean_sigma_m"][k], np.sqrt(own.sum()) / len(rows), "σ of the mean")


def test_whether_the_block_contradicts_the_calibration(considered: Considered) -> None:
    oracle, d = considered.oracle, considered.oracle.dense
    root = np.linalg.cholesky(considered.covariance)
    normal = root.T @ considered.a.T @ oracle.scatter @ considered.a @ root
    pull = -root.T @ considered.a.T @ d.p @ (d.v - d.a @ (d.q @ (d.a.T @ d.p @ d.v)))
    spread = oracle.factor**2 * normal + normal @ normal
    expected, freedom = float(pull @ np.linalg.solve(spread, pull)), len(pull)
    (found,) = oracle.results.summary["registered_calibrations"]
    assert (found["use"], found["parameters"], found["freedom"]) == ("consider", freedom, freedom)
    exactly([found["statistic"], found["probability"]], [expected, stats.chi2.sf(expected, freedom)], "T")
