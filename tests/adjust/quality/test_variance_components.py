"""Variance components: that of every group is found, with an honest interval, from wrong weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjusted
from adjust.observations.base import StochasticModel
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, ConsideredParameters, ParameterPlace
from adjust.quality.observation_parts import Division, Part, parts_of
from adjust.quality.residual_operator import ResidualOperator
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import (
    PartSums,
    reweighted,
    robust_factors,
    variance_components,
    variance_factors,
)
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.gauss_newton import Solution, iterate
from adjust.solve.system import Observations, System
from adjust.weighting import without_swinging
from tests.adjust.scenes import DEGREE, two_strips, with_rejected_distances
from tests.adjust.simulate.specifications import CAMERA, HEIGHT, small_specification

WRONG: Mapping[str, float] = {"image_points": 2.0, "gnss_positions": 3.0, "ins_attitudes": 0.4}
CONFIDENCE = 0.99
FREE = (BORESIGHT, GNSS_SHIFT)


def hundred_images() -> SimulatedBlock:
    """Ten crossing lines of ten images, 42 control points."""
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.6)
    return simulate_block(
        small_specification(
            flight=(
                LineGroup("E", "1", 0, np.pi / 2, HEIGHT, (10,) * 6, base, spacing),
                LineGroup("N", "1", 0, 0.0, HEIGHT, (10,) * 4, base, spacing),
            ),
            points=PointSpecification(count=700),
            survey=(SurveyLayout("grid", columns=7, rows=6),),
        )
    )


def wrongly_weighted(observations: Observations, wrong: Mapping[str, float] = WRONG) -> Observations:
    return Observations(
        observations.image_points.rescaled(np.array(wrong.get("image_points", 1.0))),
        tuple(group.rescaled(np.array(wrong.get(group.name, 1.0))) for group in observations.others),
    )


def estimated(block: Block, observations: Observations, **options: Any) -> AdjustmentResult:
    return adjust_block(
        block,
        observations,
        AdjustmentOptions(variance_components=True, confidence=CONFIDENCE, **options),
    )


def found_over_true(result: AdjustmentResult) -> dict[str, tuple[float, float, float, float]]:
    """Estimated over true σ with its limits, and the redundancy, of every estimated part."""
    table = {}
    for item in result.variance_components:
        if item.estimated:
            start = WRONG.get(result.groups[item.part.group].group.name, 1.0)
            values = (item.factor * start, item.lower * start, item.upper * start)
            table[item.part.name] = (*values, item.redundancy)
    return table


@pytest.fixture(scope="module")
def large() -> SimulatedBlock:
    return hundred_images()


@pytest.fixture(scope="module")
def measured(large: SimulatedBlock) -> SimulatedBlock:
    return large.measured_again(1)


@pytest.fixture(scope="module")
def from_wrong(measured: SimulatedBlock) -> AdjustmentResult:
    """A large block with weights estimated from wrong ones."""
    block = measured.block(FREE)
    return estimated(block, wrongly_weighted(measured.observations(block)))


def test_from_wrong_weights_the_large_parts_are_found_within_their_intervals(
    from_wrong: AdjustmentResult,
) -> None:
    result = from_wrong
    assert result.reweighted <= 6
    assert result.test.sigma0 == pytest.approx(1.0, abs=0.01)
    table = {name: row for name, row in found_over_true(result).items() if row[3] >= 100.0}
    assert set(table) >= {"image_points", "gnss_positions plan", "ins_attitudes roll and pitch"}
    misses = []
    for name, (_, lower, upper, _) in table.items():
        assert upper / lower < 1.8, f"the interval of {name} says something"
        if not lower < 1.0 < upper:
            misses.append((name, lower, upper))
    # All three hold the truth with this seed; the slow test counts misses over many.
    assert not misses, misses


@pytest.mark.parametrize("rejecting", [pytest.param(False, marks=pytest.mark.slow), True])
def test_sigmas_stated_so_small_that_they_leave_no_redundancy_are_estimated(
    measured: SimulatedBlock, rejecting: bool
) -> None:
    """Positions ten times too good hold all images: those in plan kept what was stated, with r of 2."""
    block = measured.block(FREE)
    wrong = wrongly_weighted(measured.observations(block), {"gnss_positions": 0.1})
    result = estimated(block, wrong, critical_value=4.13 if rejecting else None)
    for item in result.variance_components:
        if item.part.name.startswith("gnss_positions"):
            assert item.estimated, item
            assert item.lower < 10.0 < item.upper, item
            assert item.redundancy > 40.0
    assert result.groups[1].rejected + result.groups[2].rejected + result.groups[3].rejected <= 1


@pytest.mark.slow
def test_the_start_has_no_influence_on_what_is_found(
    measured: SimulatedBlock, from_wrong: AdjustmentResult
) -> None:
    block = measured.block(FREE)
    from_truth = estimated(block, measured.observations(block))
    for a, b in zip(from_truth.variance_components, from_wrong.variance_components, strict=True):
        assert b.sigma == pytest.approx(a.sigma, rel=0.02), a.part.name


def test_adjusted_values_are_those_of_the_estimated_weights(
    measured: SimulatedBlock, from_wrong: AdjustmentResult
) -> None:
    block, result = measured.block(FREE), from_wrong
    wrong = wrongly_weighted(measured.observations(block))
    factors = np.array([item.factor for item in result.variance_components])
    again = adjust_block(block, reweighted(wrong, parts_of(wrong), factors))
    np.testing.assert_allclose(again.state.object_point, result.state.object_point, atol=1e-6)
    assert again.test.weighted_squares == pytest.approx(result.test.weighted_squares, rel=1e-6)
    np.testing.assert_allclose(result.groups[1].sigma, again.groups[1].sigma)


def test_parts_are_called_after_their_components() -> None:
    observations = two_strips().observations
    found = {
        part.name: "".join(observations.groups[part.group].components[k][0] for k in part.components)
        for part in parts_of(observations)
    }
    assert found == {
        "image_points": "xy",
        "control_points plan": "xy",
        "control_points height": "z",
        "gnss_positions plan": "xy",
        "gnss_positions height": "z",
        "ins_attitudes roll and pitch": "rp",
        "ins_attitudes yaw": "y",
    }


def test_parts_with_little_redundancy_keep_their_stated_sigma() -> None:
    scene = two_strips(noise_seed=3)
    result = estimated(scene.block, scene.observations)
    weak = [item for item in result.variance_components if not item.estimated]
    assert "control_points plan" in {item.part.name for item in weak}
    for item in weak:
        assert item.factor == 1.0
        assert np.isnan([item.lower, item.upper, item.degrees_of_freedom]).all()
    assert any(item.estimated for item in result.variance_components)


def test_gross_errors_and_wrong_weights_are_told_apart(large: SimulatedBlock) -> None:
    block = large.block(FREE)
    observations = large.observations(block)
    rays = observations.image_points
    many = np.bincount(rays.point)[rays.point] >= 5
    wrong_rays = np.flatnonzero(many)[::97]
    xy = rays.xy.copy()
    xy[wrong_rays] += [60e-6, -40e-6]
    damaged = Observations(
        type(rays)(rays.image, rays.point, rays.camera_of_image, xy, rays.sigma, rays.active),
        observations.others,
    )
    result = estimated(block, wrongly_weighted(damaged), critical_value=4.13)
    rejected = np.flatnonzero(np.isnan(result.groups[0].redundancy).all(axis=1))
    assert set(wrong_rays) <= set(rejected)
    assert len(rejected) <= len(wrong_rays) + 0.001 * len(rays.image)
    # With INS σ far too small at the start, no attitude may fall victim to them.
    assert result.groups[3].rejected == 0
    for name, (_, lower, upper, redundancy) in found_over_true(result).items():
        if redundancy >= 100.0:
            assert lower < 1.0 < upper, name


def test_nothing_above_the_critical_value_is_left_at_the_settled_weights() -> None:
    """Medians within a tenth of the stated σ leave them, and there every |w| is smaller than at the end."""
    scene = two_strips(noise_seed=31, start_seed=4)
    stated = wrongly_weighted(scene.observations, {"image_points": 1.08})
    everything = estimated(scene.block, stated, critical_value=50.0)
    largest = np.nanmax(np.abs(everything.groups[0].standardized))
    result = estimated(scene.block, stated, critical_value=0.99 * largest)
    assert result.rejected_per_pass[0] > 0
    for group in result.groups:
        controlled = group.status == ObservationStatus.USED
        assert np.abs(group.standardized[controlled]).max(initial=0.0) <= 0.99 * largest


def noisier(values: Floats, chosen: Ints, sigma: Floats, ratio: float, seed: int) -> Floats:
    """Values (n, m) of which the chosen rows have `ratio` times the noise σ (n, m) they were drawn with."""
    found = values.copy()
    more = np.random.default_rng(seed).normal(size=(len(chosen), values.shape[1]))
    found[chosen] += np.sqrt(ratio**2 - 1.0) * sigma[chosen] * more
    return found


def of_two_origins(large: SimulatedBlock, seed: int) -> tuple[Block, Observations, tuple[Division, ...]]:
    """Every third image point manual with 3 µm, the others automatic with 1.5 µm, both stated 2 µm; and GNSS
    positions of which those of the later images have 2.5 times the stated σ.
    """
    measured = large.measured_again(seed)
    block = measured.block(FREE)
    observations = measured.observations(block)
    rays = observations.image_points
    gnss = next(group for group in observations.others if isinstance(group, GnssPositions))
    manual = np.arange(len(rays.image)) % 3 == 0
    later = gnss.event >= np.median(gnss.event)
    xy = noisier(rays.xy, np.flatnonzero(manual), rays.sigma, 2.0, seed)
    position = noisier(gnss.observed, np.flatnonzero(later), gnss.stochastic.sigma, 2.5, seed + 1000)
    stated = replace(rays, xy=xy, sigma=rays.sigma * (2.0 / 1.5))
    others = tuple(
        replace(gnss, observed=position) if group is gnss else group for group in observations.others
    )
    divisions = (
        Division("image_points", ("automatic.csv", "manual.csv"), manual.astype(np.int64)),
        Division("gnss_positions", ("flight 1", "flight 2"), later.astype(np.int64)),
    )
    return block, Observations(stated, others), divisions


TRUE_FACTORS = {
    "image_points of automatic.csv": 0.75,
    "image_points of manual.csv": 1.5,
    "gnss_positions plan of flight 1": 1.0,
    "gnss_positions plan of flight 2": 2.5,
}


def test_a_considered_boresight_leaves_the_components_as_an_observed_one_does() -> None:
    """Its error of two σ of an attitude made them 2.3 times as large."""
    scene = two_strips(strips=3, images_per_strip=8, points_along=17, points_across=11, noise_seed=2, free={})
    sigma = 0.006 * DEGREE
    places = tuple(ParameterPlace(BORESIGHT, 0, component) for component in range(3))
    known = ConsideredParameters(places, sigma**2 * np.eye(3))
    system = tuple(
        replace(item, values=item.values + np.array([2.0, -1.0, 2.0]) * sigma)
        if item.family.name == BORESIGHT
        else item
        for item in scene.block.system
    )
    block = replace(scene.block, system=system, considered=known)
    (given,) = (item.values[:1] for item in system if item.family.name == BORESIGHT)
    model = StochasticModel.from_covariance(known.covariance[None], np.ones((1, 3), dtype=bool))
    prior = JointPrior("C", ("roll", "pitch", "yaw"), ("rad",) * 3, places, given, model)
    observed = Observations(scene.observations.image_points, (*scene.observations.others, prior))
    free = tuple(
        replace(item, free=item.free | (item.family.name == BORESIGHT)) for item in scene.block.system
    )
    of_both = [
        {item.part.name: item for item in estimated(*case).variance_components if item.estimated}
        for case in ((block, scene.observations), (replace(scene.block, system=free), observed))
    ]
    assert of_both[0].keys() == of_both[1].keys() >= {"ins_attitudes roll and pitch", "ins_attitudes yaw"}
    for one, other in ((items[name] for items in of_both) for name in of_both[0]):
        assert one.factor == pytest.approx(other.factor, rel=2e-3)
        assert one.redundancy == pytest.approx(other.redundancy, rel=2e-3)
        assert one.degrees_of_freedom == pytest.approx(other.degrees_of_freedom, rel=1e-3)


def test_points_of_two_files_and_positions_of_two_flights_get_their_own_sigma(large: SimulatedBlock) -> None:
    block, observations, divisions = of_two_origins(large, 0)
    result = estimated(block, observations, divisions=divisions)
    found = {item.part.name: item for item in result.variance_components}
    for name, true in TRUE_FACTORS.items():
        assert found[name].lower < true < found[name].upper, name
        assert found[name].upper / found[name].lower < 2.5, name
    # The parts share the redundancy of their group, and all of them that of the block.
    for index, group in enumerate(result.groups):
        own = [item.redundancy for item in found.values() if item.part.group == index]
        assert sum(own) == pytest.approx(group.redundancy_sum)
    assert sum(item.redundancy for item in found.values()) == pytest.approx(result.test.redundancy, rel=1e-9)
    # A point keeps the σ of its file.
    manual = divisions[0].of_observation == 1
    sigma = result.groups[0].sigma
    assert np.median(sigma[manual]) / np.median(sigma[~manual]) == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
def test_one_component_for_both_files_is_neither(large: SimulatedBlock) -> None:
    block, observations, _ = of_two_origins(large, 0)
    found = {item.part.name: item for item in estimated(block, observations).variance_components}
    assert 0.75 < found["image_points"].lower < found["image_points"].upper < 1.5


def test_a_division_of_other_observations_is_refused(large: SimulatedBlock) -> None:
    block = large.block(FREE)
    wrong = Division("image_points", ("a",), np.zeros(3, dtype=np.int64))
    with pytest.raises(InconsistentBlockError, match="has 3 observations"):
        estimated(block, large.observations(block), divisions=(wrong,))


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_intervals_of_divided_groups_hold_the_truth_as_often_as_they_say(large: SimulatedBlock) -> None:
    trials, misses = 60, dict.fromkeys(TRUE_FACTORS, 0)
    for seed in range(trials):
        block, observations, divisions = of_two_origins(large, seed)
        result = estimated(block, observations, divisions=divisions)
        found = {item.part.name: item for item in result.variance_components}
        for name, true in TRUE_FACTORS.items():
            misses[name] += not found[name].lower < true < found[name].upper
    for name, missed in misses.items():
        assert missed <= stats.binom.isf(1e-3, trials, 1.0 - CONFIDENCE), (name, missed)


@pytest.fixture(scope="module")
def dense() -> Callable[..., tuple[System, Any, Floats, list[Floats]]]:
    """A small block with its full residual operator R and the rows of every part."""

    scene = two_strips(noise_seed=4, points_along=7, points_across=4, images_per_strip=6)

    def build(factors: Floats | None = None) -> tuple[System, Any, Floats, list[Floats]]:
        observations = scene.observations
        if factors is not None:
            observations = reweighted(observations, parts_of(observations), factors)
        system = System.of(scene.block, observations)
        solution = iterate(system, scene.block.approximate_state(), 20)
        design = design_matrix(system, solution.state)
        matrix = design.matrix.toarray()
        remainder = np.eye(len(matrix)) - matrix @ full_cofactor(design) @ matrix.T
        rows = []
        for part in parts_of(observations):
            model = observations.groups[part.group].stochastic
            mask = np.zeros(model.present.shape, dtype=bool)
            mask[:, list(part.components)] = model.present[:, list(part.components)]
            rows.append(design.row_start[part.group] + np.flatnonzero(mask.ravel()))
        return system, solution, remainder, rows

    return build


def sums_of(system: System, solution: Solution, parts: tuple[Part, ...]) -> PartSums:
    return PartSums.of(Adjusted(system, solution, ()), parts)


def test_the_residual_operator_is_that_of_the_full_equations(dense: Callable[..., Any]) -> None:
    system, solution, remainder, _ = dense()
    random = np.random.default_rng(5)
    present = [group.stochastic.present for group in system.observations.groups]
    vectors = tuple(np.where(mask, random.normal(size=mask.shape), 0.0) for mask in present)
    found = np.concatenate(
        [part.ravel() for part in ResidualOperator.of(system, solution).residuals(vectors)]
    )
    expected = remainder @ np.concatenate([vector.ravel() for vector in vectors])
    used = np.concatenate([mask.ravel() for mask in present])
    np.testing.assert_allclose(found[used], expected[used], atol=2e-3)


def test_probed_traces_are_those_of_the_full_equations(dense: Callable[..., Any]) -> None:
    system, solution, remainder, rows = dense()
    parts = parts_of(system.observations)
    exact = np.array([[np.sum(remainder[np.ix_(g, h)] ** 2) for h in rows] for g in rows])
    redundancy = sums_of(system, solution, parts).redundancy
    probed = trace_matrix(system, solution, parts, np.maximum(redundancy, 1.0))
    size = np.sqrt(np.outer(np.diagonal(exact), np.diagonal(exact)))
    assert np.abs((probed - exact) / size).max() < 0.1
    # R is idempotent, so a whole row is the redundancy: Förstner's and Helmert's estimates agree where
    # all factors are one. Only correlated control shares its rows between plan and height.
    apart = [k for k, part in enumerate(parts) if not part.name.startswith("control_points")]
    np.testing.assert_allclose(exact.sum(axis=1)[apart], redundancy[apart], rtol=1e-5)


def test_probed_traces_count_shared_readings_by_their_shares(dense: Callable[..., Any]) -> None:
    system, solution, remainder, rows = dense()
    gnss = next(group for group in system.observations.others if isinstance(group, GnssPositions))
    shares = np.where(np.arange(len(gnss.event)) % 3 == 0, 1.0, 0.5)
    shared = replace(gnss, stochastic=replace(gnss.stochastic, share=shares))
    others = tuple(shared if group is gnss else group for group in system.observations.others)
    system = System.of(system.block, replace(system.observations, others=others))
    parts = parts_of(system.observations)
    every = [
        np.broadcast_to(g.stochastic.shares, g.stochastic.present.shape) for g in system.observations.groups
    ]
    of_row = np.concatenate([one.ravel() for one in every])
    redundancy = sums_of(system, solution, parts).redundancy
    alone = [k for k, part in enumerate(parts) if not part.name.startswith("control_points")]
    own = np.array([np.sum((of_row * np.diagonal(remainder))[part]) for part in rows])
    np.testing.assert_allclose(redundancy[alone], own[alone], rtol=1e-5)
    root = np.sqrt(of_row)
    weighted = remainder**2 * np.outer(root, root)
    exact = np.array([[np.sum(weighted[np.ix_(g, h)]) for h in rows] for g in rows])
    probed = trace_matrix(system, solution, parts, np.maximum(redundancy, 1.0))
    size = np.sqrt(np.outer(np.diagonal(exact), np.diagonal(exact)))
    assert np.abs((probed - exact) / size).max() < 0.1


def test_a_shared_reading_counts_once_in_the_sigma0_of_its_group_and_in_the_median() -> None:
    """Readings of two heads: each has half of an observation, √2 of its σ, and r near 1."""
    scene = two_strips(noise_seed=4)
    result = adjust_block(scene.block, scene.observations)
    adjusted = Adjusted(result.system, result.solution, ())
    number = next(k for k, item in enumerate(result.groups) if isinstance(item.group, GnssPositions))
    own: Any = result.groups[number]
    half = replace(own.group.stochastic, share=np.full(len(own.residual), 0.5))
    shared = replace(own, group=replace(own.group, stochastic=half))
    assert shared.sigma0 == pytest.approx(np.sqrt(2.0) * own.sigma0)
    parts = parts_of(adjusted.observations)
    others = tuple(
        replace(group, stochastic=half) if isinstance(group, GnssPositions) else group
        for group in adjusted.observations.others
    )
    halved = replace(adjusted.observations, others=others)
    one, other = (
        robust_factors(given, adjusted.residuals, parts) for given in (adjusted.observations, halved)
    )
    np.testing.assert_allclose(other / one, [np.sqrt(2.0) if part.group == number else 1.0 for part in parts])


def test_the_fixed_point_is_that_of_helmerts_rigorous_estimate(dense: Callable[..., Any]) -> None:
    """Iterated by the simplified step alone until it stands still; then S σ² = q must give σ² = 1."""
    factors, free = np.ones(7), np.array([True, False, False, False, False, True, True])
    for _ in range(60):
        system, solution, remainder, rows = dense(factors)
        parts = parts_of(system.observations)
        step = np.where(free, variance_factors(sums_of(system, solution, parts), parts), 1.0)
        factors = factors * step
        if np.abs(step - 1.0).max() < 1e-7:
            break
    assert np.abs(factors[free] - 1.0).max() > 0.02
    v = remainder @ design_matrix(system, solution.state).misclosure
    exact = np.array([[np.sum(remainder[np.ix_(g, h)] ** 2) for h in rows] for g in rows])
    q = np.array([np.sum(v[g] ** 2) for g in rows])
    # The parts that keep their weights contribute a known share to every q.
    components = np.linalg.solve(exact[np.ix_(free, free)], (q - exact[:, ~free].sum(axis=1))[free])
    np.testing.assert_allclose(components, 1.0, atol=1e-5)


def test_degrees_of_freedom_and_limits_are_those_of_the_full_matrices(dense: Callable[..., Any]) -> None:
    system, solution, remainder, rows = dense()
    parts, adjusted = parts_of(system.observations), Adjusted(system, solution, ())
    factors = 0.5 + 0.25 * np.arange(len(parts))
    frozen = np.array([part.name.startswith("control_points") for part in parts])
    free = np.flatnonzero(~frozen)
    exact = np.array([[np.sum(remainder[np.ix_(rows[g], rows[h])] ** 2) for h in free] for g in free])
    found, _ = variance_components(adjusted, parts, factors, frozen, 0.9)
    degrees = 1.0 / np.diagonal(np.linalg.inv(exact))
    assert np.any(degrees < 0.9 * np.diagonal(exact)), "parts borrow from each other"
    for k, expected in zip(free, degrees, strict=True):
        item, d = found[k], found[k].degrees_of_freedom
        assert item.redundancy == pytest.approx(np.sum(np.diagonal(remainder)[rows[k]]), rel=1e-5)
        assert d == pytest.approx(expected, rel=0.1)
        assert item.factor == factors[k]
        assert item.lower == pytest.approx(factors[k] * np.sqrt(d / stats.chi2.ppf(0.95, d)))
        assert item.upper == pytest.approx(factors[k] * np.sqrt(d / stats.chi2.ppf(0.05, d)))
    assert not any(found[k].estimated for k in np.flatnonzero(frozen))
    # Of each part the median of its own σ, which heights have twice as large.
    sigma = {item.part.name: item.sigma for item in found}
    assert sigma["gnss_positions height"] == pytest.approx(2.0 * sigma["gnss_positions plan"])
    assert sigma["image_points"] == pytest.approx(2e-6)


def test_of_image_points_of_unlike_sigmas_the_median_is_stated() -> None:
    """A third of them measured by hand, four times as badly: the mean would be twice as large."""
    scene = two_strips(noise_seed=4)
    rays = scene.observations.image_points
    by_hand = np.where(np.arange(len(rays.image)) % 3 == 0, 4.0, 1.0)[:, None]
    observations = replace(scene.observations, image_points=rays.rescaled(by_hand))
    found = next(item for item in estimated(scene.block, observations).variance_components)
    assert found.part.name == "image_points"
    assert found.sigma == pytest.approx(2e-6 * found.factor)


def test_the_median_of_right_sigmas_gives_a_factor_of_one() -> None:
    scene = two_strips(points_along=40, points_across=12, noise_seed=4)
    result = adjust_block(scene.block, scene.observations)
    adjusted = Adjusted(result.system, result.solution, ())
    factors = robust_factors(adjusted.observations, adjusted.residuals, parts_of(adjusted.observations))
    assert factors[0] == pytest.approx(1.0, abs=0.1)


def test_a_part_that_turns_back_stops_where_it_would_cross() -> None:
    """x ← x − 1.9 x swings for ever so long; once it turns back the crossing is known."""
    step = without_swinging(np.exp([0.9, -0.9, 0.2, 0.2]), np.array([-1.0, -1.0, 0.0, -1.0]))
    np.testing.assert_allclose(np.log(step), [0.9 / 1.9, -0.9, 0.2, 0.2])


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_intervals_hold_the_truth_as_often_as_they_say(large: SimulatedBlock) -> None:
    """150 blocks from wrong weights: coverage of the 99 % intervals, spread of the estimates, rounds."""
    trials = 150
    inside: dict[str, list[bool]] = {}
    normalized: dict[str, list[float]] = {}
    rounds = []
    for seed in range(trials):
        measured = large.measured_again(seed)
        block = measured.block(FREE)
        result = estimated(block, wrongly_weighted(measured.observations(block)))
        rounds.append(result.reweighted)
        degrees = {item.part.name: item.degrees_of_freedom for item in result.variance_components}
        for name, (value, lower, upper, redundancy) in found_over_true(result).items():
            if redundancy >= 50.0:
                inside.setdefault(name, []).append(lower < 1.0 < upper)
                normalized.setdefault(name, []).append((value**2 - 1.0) * np.sqrt(0.5 * degrees[name]))
    assert np.mean(np.array(rounds) <= 6) >= 0.95
    for name, hits in inside.items():
        # Two-sided 0.1 % would allow at most six misses of 150 at 1 %.
        assert len(hits) - sum(hits) <= stats.binom.isf(1e-3, trials, 1.0 - CONFIDENCE), name
        spread = float(np.std(normalized[name]))
        assert spread == pytest.approx(1.0, abs=3.3 / np.sqrt(2.0 * trials) + 0.05), name


def test_what_was_never_used_keeps_its_stated_sigma() -> None:
    """Check distances, as check points: the survey of a check is not an observation of the block."""
    checks = (0, 7, 30)
    plan = {"distances": 40, "sigma_distance_m": 1.0, "points_along": 17, "points_across": 11}
    scene = with_rejected_distances(two_strips(noise_seed=4, **plan), checks)
    result = estimated(scene.block, wrongly_weighted(scene.observations, {"distances": 0.25}))
    (component,) = (item for item in result.variance_components if item.part.name == "distances")
    assert component.estimated
    assert component.factor > 2.0
    (group,) = (item for item in result.groups if item.group.name == "distances")
    stated = 0.25 * scene.plan.sigma_distance_m
    is_check = np.isin(np.arange(40), checks)
    assert np.all(group.status[is_check] == ObservationStatus.NOT_USED)
    np.testing.assert_allclose(group.sigma[is_check], stated, rtol=1e-12)
    np.testing.assert_allclose(group.sigma[~is_check], component.factor * stated, rtol=1e-12)
