"""Change of the noise of scenes between two dates: false alarms as seldom as is said."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from adjust.arrays import Floats
from tasks.image_quality.dates import LIMIT, noise_changes

SIGMA, NOISE, TRIALS = 0.05, 5.0, 300


def levels(count: int, low: float, high: float, random: np.random.Generator) -> pd.DataFrame:
    """Grey levels of a sensor whose noise is the same at all of them."""
    level: Floats = np.linspace(low, high, count)
    noise = NOISE + random.normal(0.0, SIGMA, count)
    return pd.DataFrame({"band": 1, "level": level, "noise": noise, "sigma_noise": SIGMA})


@pytest.mark.parametrize(("earlier", "now"), [(16, 16), (2, 16), (3, 16)])
def test_an_unchanged_sensor_has_changed_as_seldom_as_is_said(earlier: int, now: int) -> None:
    """Two earlier levels, with which sixteen of now are compared, have two errors and not sixteen."""
    random = np.random.default_rng(1)
    t = np.array(
        [
            row["t"]
            for _ in range(TRIALS)
            for row in noise_changes(levels(now, 10, 200, random), levels(earlier, 5, 210, random))
        ]
    )
    assert len(t) == TRIALS
    low, high = np.sqrt(stats.chi2.interval(0.999, TRIALS) / np.array(TRIALS))
    assert low <= np.sqrt(np.mean(t**2)) <= high
    assert np.sum(np.abs(t) > LIMIT) <= stats.binom.isf(0.0005, TRIALS, 0.001)
