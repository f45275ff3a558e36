"""Change of the noise of scenes between two dates: false alarms as seldom as is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from adjust.arrays import Floats
from tasks.image_quality.dates import drift_table, noise_changes
from tasks.image_quality.radiometric_record import LIMIT
from tasks.tables.parquet import write_table
from tasks.tables.schemas.image_quality import EDGE_MEANS

SIGMA, NOISE, TRIALS = 0.05, 5.0, 300


def levels(count: int, low: float, high: float, random: np.random.Generator) -> pd.DataFrame:
    """Grey levels of a sensor whose noise is the same at all of them; every trial is a band."""
    band = np.repeat(np.arange(TRIALS), count)
    level: Floats = np.tile(np.linspace(low, high, count), TRIALS)
    noise = NOISE + random.normal(0.0, SIGMA, len(band))
    return pd.DataFrame({"band": band, "level": level, "noise": noise, "sigma_noise": SIGMA})


@pytest.mark.parametrize(("earlier", "now"), [(16, 16), (2, 16), pytest.param(3, 16, marks=pytest.mark.slow)])
def test_an_unchanged_sensor_has_changed_as_seldom_as_is_said(earlier: int, now: int) -> None:
    """Two earlier levels, with which sixteen of now are compared, have two errors and not sixteen."""
    random = np.random.default_rng(1)
    changes = noise_changes(levels(now, 10, 200, random), levels(earlier, 5, 210, random))
    t = np.array([row["t"] for row in changes])
    assert len(t) == TRIALS
    low, high = np.sqrt(stats.chi2.interval(0.999, TRIALS) / np.array(TRIALS))
    assert low <= np.sqrt(np.mean(t**2)) <= high
    assert np.sum(np.abs(t) > LIMIT) <= stats.binom.isf(0.0005, TRIALS, 0.001)


@pytest.mark.parametrize(("edges", "drifted"), [(3, False), (200, True)])
def test_a_change_of_a_mean_of_few_edges_needs_more_standard_deviations(
    edges: int, drifted: bool, tmp_path: Path
) -> None:
    """4 σ: with three edges at each date chance alone does that in 1.6 % of all cases."""

    def means(factor: float) -> pd.DataFrame:
        row: dict[str, object] = {column.name: 0.0 for column in EDGE_MEANS.columns}
        row |= {"band": 1, "direction": "all", "zone": "all", "edges": edges, "method": "model"}
        return pd.DataFrame([{**row, "factor": factor, "sigma_factor": 0.01 / np.sqrt(2.0)}])

    then = means(1.20)
    columns = {column.name: then[column.name].tolist() for column in EDGE_MEANS.columns}
    write_table(tmp_path / "edge_means.parquet", EDGE_MEANS, columns)
    drift = drift_table(means(1.24), tmp_path / "edge_means.parquet")
    assert drift["t"][0] == pytest.approx(4.0)
    assert drift["drifted"][0] == drifted
