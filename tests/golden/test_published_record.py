"""The covariance of a calibration's record by dense algebra: what was estimated, and what was held with a σ.

Σ = σ0² Q + Σ_b σ_b² e_b e_bᵀ, e_b = −Q Aᵀ P c_b (considered quantities); docs/calibration.md.
"""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from tests.flows.calibration_alone import calibration_alone
from tests.golden.delivered_block import UNITS
from tests.golden.oracle import SMALL, Oracle, computed, exactly, simulated
from tests.golden.test_published_statistics import Alternatives

FLIGHT = (
    *SMALL,
    "truth.strip_bias_m=[0.03,0.03,0.05]",
    "truth.refraction=true",
    'project.free=["boresight", "gnss_shift", "gnss_strip_bias", "principal_point"]',
)
HELD = {
    **{f"lever_arm_{axis}": 0.01 for axis in "xyz"},
    **{f"control_shift_{axis}": 0.02 for axis in "xyz"},
    "time_offset": 0.0002,
    "refraction": 0.05,
}


@pytest.fixture(scope="module")
def oracle(tmp_path_factory: pytest.TempPathFactory) -> Oracle:
    project = simulated(tmp_path_factory.mktemp("record"), "uce-high", FLIGHT)
    return Oracle.of(project, computed(project, ("calibration.two_step=false",), calibration_alone))


def test_covariance_of_the_record(oracle: Oracle) -> None:
    d, record = oracle.dense, json.loads((oracle.results.folder / "calibration.json").read_text())
    estimated = [item for item in record["parameters"] if item.get("sigma") is not None]
    names = [(item["parameter"], item["entity"]) for item in estimated]
    assert len(names) == 8
    columns = [oracle.free[name] for name in names]
    unit = np.array([oracle.unit_of(name) for name in names])
    covariance = oracle.factor**2 * d.q[np.ix_(columns, columns)]
    listed = Alternatives(oracle)
    table = oracle.results.table("model_alternatives").fillna({"entity": "", "part": ""})
    table = table[(table["scope"] == "all") & table["quantity"].isin(HELD)]
    shares: dict[tuple[str, str], float] = {}
    for _, row in table.iterrows():
        column = listed.column(row)
        assert column is not None
        moved = d.q @ (d.a.T @ (d.p @ column[d.used])) * HELD[row["quantity"]]
        moved = moved[columns] * UNITS.get(row["unit"], 1.0)
        covariance += np.outer(moved, moved)
        shares[row["quantity"], row["entity"]] = moved
    sigma = np.sqrt(np.diagonal(covariance))
    exactly([item["sigma"] for item in estimated], sigma / unit, "certified σ")
    of_sigma = np.outer(sigma / unit, sigma / unit)
    exactly(record["covariance"], covariance / np.outer(unit, unit), "covariance", of=of_sigma)
    held = pd.DataFrame(record["held"]).fillna({"entity": ""}).set_index(["quantity", "entity"])
    assert set(held.index) == set(shares)
    for name, moved in shares.items():
        part = np.abs(moved) / sigma
        most = int(np.argmax(part))
        assert (held.loc[name, "moves"], held.loc[name, "moves_entity"]) == names[most]
        exactly(
            [held.loc[name, "part"], held.loc[name, "sigma"]], [part[most], HELD[name[0]]], "part of held"
        )
    # What is held is a part of it.
    alone = oracle.factor * oracle.spread[columns]
    assert (sigma / alone).max() > 1.2
