"""Correlation times by dense algebra, from the delivered files and the adjusted values.

The restricted likelihood (Patterson and Thompson 1971) and its information, with the matrices dΣ/dθ of all
variance components and correlation times; formulas: docs/theory/adjustment.md.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.golden.likelihood import Likelihood
from tests.golden.oracle import CORRELATED, Case, Oracle, nothing

ESTIMATED = "adjustment.estimate_correlation=true"
CASES = {
    "alone": Case(
        (*CORRELATED, "truth.strip_bias_m=[0.03,0.03,0.05]"),
        nothing,
        (ESTIMATED,),
    ),
    "with variance components": Case(
        CORRELATED,
        nothing,
        (ESTIMATED, "adjustment.variance_components=true"),
    ),
}


@pytest.fixture(scope="module", params=CASES)
def likelihood(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Likelihood:
    return Likelihood(Oracle.of_case(CASES[request.param], tmp_path_factory.mktemp("delivered")))


def test_the_likelihood_is_largest(likelihood: Likelihood) -> None:
    step = np.linalg.solve(likelihood.traces, likelihood.score)
    assert len(step) == len(likelihood.components) + 2
    assert (np.abs(step) < 0.02 * likelihood.spread).all()


def test_limits_of_correlation_times(likelihood: Likelihood) -> None:
    """Values of ζ with whose own standard deviation the estimate is compatible (Wilson 1927)."""
    timing = likelihood.timing
    ends = np.arctanh([0.01, np.exp(-timing.interval / (10.0 * timing.longest))])
    values, verdicts = np.linspace(*ends, 10001), list[str]()
    for name, item in likelihood.times.items():
        zeta, sigma = timing.zeta(item["correlation_s"]), likelihood.spread[likelihood.estimated.index(name)]
        stated = likelihood.oracle.block.settings[f"{name.split('_')[0]}_correlation_s"]
        assert item["stated_s"] == stated != item["correlation_s"]
        known = 1.0 - 2.0 / timing.exposures
        of_values = sigma * np.sqrt((1.0 - known * np.tanh(zeta) ** 2) / (1.0 - known * np.tanh(values) ** 2))
        inside = values[np.abs(values - zeta) <= stats.norm.ppf(0.975) * of_values]
        white, constant = inside[0] == ends[0], inside[-1] == ends[1]
        names = {(True, False): "none", (False, True): "longer", (True, True): "undetermined"}
        assert item["verdict"] == names.get((white, constant), "estimated")
        verdicts.append(item["verdict"])
        assert (item["lower_s"] == 0.0) == white
        assert (item["upper_s"] is None) == constant
        # σ by traces of random signs, in steps of a thousandth of the range.
        limits = [(item["lower_s"], inside[0], white), (item["upper_s"], inside[-1], constant)]
        found = [(timing.zeta(seconds), limit) for seconds, limit, open_end in limits if not open_end]
        for limit, expected in found:
            assert limit == pytest.approx(
                expected, abs=0.1 * abs(expected - zeta) + (ends[1] - ends[0]) / 1000
            )
    assert set(verdicts) >= {"estimated", "none"}
