"""The search for the weights: which parts stand still, and when factors have settled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.data_snooping import Search
from adjust.least_squares import Adjuster
from adjust.observations.gnss_position import GnssPositions
from adjust.options import AdjustmentOptions
from adjust.quality.observation_parts import correlations_of, parts_of
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import reweighted
from adjust.solve.system import Observations, System
from adjust.weighting import Weighted, tolerances
from tests.adjust.scenes import Scene, two_strips


def weighted(scene: Scene, errors: Floats | None = None) -> Weighted:
    """With the weights as stated, and errors (n, 3) added to the positions, metres."""
    others = tuple(
        replace(group, observed=group.observed + errors)
        if isinstance(group, GnssPositions) and errors is not None
        else group
        for group in scene.observations.others
    )
    observations = Observations(scene.observations.image_points, others)
    adjusted = Adjuster(AdjustmentOptions()).adjust(System.of(scene.block, observations), scene.truth)
    parts = (*parts_of(observations), *correlations_of(observations))
    nothing = np.zeros(len(parts), dtype=bool)
    return Weighted(Search.start(observations, adjusted), parts, np.ones(len(parts)), nothing, 0)


def place_of(found: Weighted, name: str, *, is_correlation: bool = False) -> int:
    return next(
        k for k, part in enumerate(found.parts) if (part.name, part.is_correlation) == (name, is_correlation)
    )


@pytest.mark.parametrize(("name", "axes"), [("plan", [0, 1]), ("height", [2])])
def test_what_is_weak_stands_until_its_squares_are_two_sigma_above_their_mean(
    name: str, axes: list[int]
) -> None:
    """Ω has the mean r and the variance 2 S; without noise it grows with the square of an error."""
    scene = two_strips()
    pattern = np.zeros((len(scene.block.images), 3))
    pattern[:, axes] = np.random.default_rng(3).normal(0.0, 1e-3, (len(pattern), len(axes)))
    small = weighted(scene, pattern)
    part, adjusted = place_of(small, f"gnss_positions {name}"), small.search.adjusted
    redundancy, squares = (values[part] for values in (small.sums.redundancy, small.sums.squares))
    assert small.weak[part]
    assert small.standing[part]
    traces = trace_matrix(adjusted.system, adjusted.solution, (small.parts[part],), np.array([redundancy]))
    for beyond, stands in ((1.9, True), (2.1, False)):
        wanted = redundancy + beyond * np.sqrt(2.0 * traces[0, 0])
        found = weighted(scene, pattern * np.sqrt(wanted / squares))
        assert found.sums.squares[part] == pytest.approx(wanted, rel=1e-3)
        assert found.standing[part] == stands


def test_a_weak_correlation_time_stands_whatever_its_residuals_are() -> None:
    """Large residuals say that the σ are too small, and nothing of how long the errors last."""
    scene = two_strips(images_per_strip=3, gnss_correlation_s=12.0)
    found = weighted(scene, np.random.default_rng(3).normal(0.0, 0.5, (len(scene.block.images), 3)))
    assert not found.standing[place_of(found, "gnss_positions plan")]
    time = place_of(found, "gnss_positions", is_correlation=True)
    assert found.weak[time]
    assert found.standing[time]


def test_factors_have_settled_within_one_percent_and_a_fifth_of_their_standard_deviation() -> None:
    found = weighted(two_strips(points_along=24))
    allowed, redundancy = tolerances(found), found.sums.redundancy
    assert redundancy[0] > 250.0
    assert allowed[0] == pytest.approx(0.2 / np.sqrt(2.0 * redundancy[0]))
    np.testing.assert_array_equal(allowed[1:], 0.01)


def test_the_factor_of_a_correlation_multiplies_the_time_and_no_sigma() -> None:
    found = weighted(two_strips(images_per_strip=3, gnss_correlation_s=12.0))
    factors = np.ones(len(found.parts))
    factors[place_of(found, "gnss_positions", is_correlation=True)] = 3.0
    others = reweighted(found.search.given, found.parts, factors).others
    (before, after) = (
        next(group.stochastic for group in groups if isinstance(group, GnssPositions))
        for groups in (found.search.given.others, others)
    )
    assert before.over_time is not None
    assert after.over_time is not None
    assert after.over_time.correlation_time == pytest.approx(3.0 * before.over_time.correlation_time)
    np.testing.assert_array_equal(after.sigma, before.sigma)
