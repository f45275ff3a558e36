"""Measured distances by dense algebra, from the delivered files and the adjusted values."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tests.golden.oracle import Case, Oracle, exactly, with_distances


def with_an_error(folder: Path) -> None:
    """The first of sixteen distances is 1 m wrong."""
    with_distances(folder, 16)
    file = folder / "distances.csv"
    table = pd.read_csv(file, dtype={"point": str, "other_point": str})
    table.loc[0, "distance"] += 1000.0
    table.to_csv(file, index=False)


CASES = {
    "a wrong distance": Case((), with_an_error, ("adjustment.rejection={}",)),
    "variance components": Case(
        ("truth.strip_bias_m=[0.03,0.03,0.05]",),
        partial(with_distances, count=48),
        ("adjustment.variance_components=true",),
    ),
}


@pytest.fixture(scope="module", params=CASES)
def oracle(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Oracle:
    return Oracle.of_case(CASES[request.param], tmp_path_factory.mktemp("delivered"))


def test_distances(oracle: Oracle) -> None:
    """Of those used √(σ0² (σ² − q)), of others √(σ² + σ0² q), with the σ that the adjustment used.

    That of a check is the stated one: what the block says of its distances says nothing of another.
    """
    d, table = oracle.dense, oracle.results.table("distance_residuals")
    given = oracle.block.measured.set_index(["point", "other_point"])
    ends = list(zip(table["point"], table["other_point"], strict=True))
    assert set(ends) == set(given.index)
    rows = [d.keys.index((f"distances:{other}", "", point, "distance")) for point, other in ends]
    q = oracle.factor**2 * np.einsum("ij,jk,ik->i", d.all_a[rows], d.q, d.all_a[rows])
    used, check = d.used[rows], (given["role"].loc[ends] == "check").to_numpy()
    own = np.where(check, given["sigma"].loc[ends], d.sigma[rows])
    sigma = np.sqrt(np.where(used, oracle.factor**2 * own**2 - q, own**2 + q))
    exactly(table["distance_m"], given["distance"].loc[ends], "distance", tolerance=1e-12)
    exactly(table["difference_m"], d.all_v[rows], "difference", of=sigma, tolerance=1e-6)
    exactly(table["sigma_difference_m"], sigma, "σ of a difference", tolerance=1e-7)
    np.testing.assert_array_equal(
        table["status"], np.where(used, "used", np.where(check, "check", "rejected"))
    )
    every = oracle.results.table("residuals").set_index(["group", "point"])
    every = every.loc[[(f"distances:{other}", point) for point, other in ends]]
    exactly(every["residual"], d.all_v[rows], "v", of=sigma, tolerance=1e-6)
    exactly(every["sigma"], own, "σ", tolerance=1e-9)


def test_figures(oracle: Oracle) -> None:
    table, figure = oracle.results.table("distance_residuals"), oracle.results.summary["distances"]
    values = {status: own["difference_m"].to_numpy() for status, own in table.groupby("status")}
    sigma = table.loc[table["status"] == "check", "sigma_difference_m"]
    limit = stats.norm.ppf(1.0 - 0.025 / len(sigma)) * sigma
    expected = {
        "used": len(values["used"]),
        "rejected": len(values.get("rejected", ())),
        "check": len(values["check"]),
        "rms_used_m": np.sqrt((values["used"] ** 2).mean()),
        "rms_check_m": np.sqrt((values["check"] ** 2).mean()),
        "max_check_m": np.abs(values["check"]).max(),
        "confidence": 0.95,
        "over_limit": (np.abs(values["check"]) / limit).max(),
    }
    assert set(figure) == set(expected)
    for name, value in expected.items():
        exactly(figure[name], value, name, tolerance=1e-12)
