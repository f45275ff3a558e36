"""Whether σ are those of the errors where considered parameters are wrong by errors of their own σ.

A block of 32 images at 1000 m is adjusted with a focal length that is wrong by ±2 µm. The errors of the focal
length are the quantiles of the normal distribution in random order, so that few trials have its variance. The
seed of a trial is its number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.block import Block
from adjust.least_squares import Adjuster
from adjust.observations.base import StochasticModel
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import INS_STRIP_BIAS, INTERIOR_ORIENTATION, ConsideredParameters, ParameterPlace
from adjust.quality.considered import with_considered
from adjust.quality.observation_parts import parts_of
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import PartSums
from adjust.solve.system import Observations, System
from tests.adjust.scenes import DEGREE, MICROMETRE, ControlKind, two_strips

SIGMA_C = 2.0 * MICROMETRE
PLACE = ParameterPlace(INTERIOR_ORIENTATION, 0, 0)
CONTROL: dict[str, tuple[ControlKind, ...]] = {"no control": (), "five control points": ("full",) * 5}


@dataclass(frozen=True, eq=False)
class Trials:
    """Squares of errors in height over their variance, means over points; (trials,) each.

    Attributes
    ----------
    held, considered, prior : of the three modes.
    statistic : T of the considered focal length.
    """

    held: Floats
    considered: Floats
    prior: Floats
    statistic: Floats

    @classmethod
    def of(cls, count: int, control: tuple[ControlKind, ...]) -> Trials:
        quantiles = stats.norm.ppf((np.arange(count) + 0.5) / count)
        errors = np.random.default_rng(1).permutation(quantiles / quantiles.std()) * SIGMA_C
        rows = [trial(seed, float(error), control) for seed, error in enumerate(errors)]
        return cls(*np.array(rows).T)

    def over_sigma(self, mode: str) -> float:
        """Root mean square of error over σ."""
        return float(np.sqrt(getattr(self, mode).mean()))


def trial(seed: int, error: float, control: tuple[ControlKind, ...]) -> tuple[float, float, float, float]:
    scene = two_strips(
        strips=4, images_per_strip=8, points_along=17, points_across=13, control=control, noise_seed=seed,
        sigma_image_m=0.5 * MICROMETRE, sigma_control_m=0.03, sigma_gnss_m=0.02,
    )  # fmt: skip
    block = with_focal_length(scene.block, error, free=False)
    covariance = np.array([[SIGMA_C**2]])
    considered = replace(block, considered=ConsideredParameters((PLACE,), covariance))
    adjuster = Adjuster(AdjustmentOptions())
    one = adjuster.adjust(System.of(considered, scene.observations, 1), block.approximate_state())

    given = block.system[0].values[0, 0] + np.zeros((1, 1))
    model = StochasticModel.from_covariance(covariance[None], np.ones((1, 1), dtype=bool))
    prior = JointPrior("camera", ("focal_length",), ("m",), (PLACE,), given, model)
    observations = Observations(scene.observations.image_points, (*scene.observations.others, prior))
    free = with_focal_length(scene.block, error, free=True)
    other = adjuster.adjust(System.of(free, observations, 1), block.approximate_state())

    def ratio(heights: Floats, of_points: Floats) -> float:
        return float(np.nanmean((heights - scene.truth.object_point[:, 2]) ** 2 / of_points[:, 2, 2]))

    z = one.state.object_point[:, 2]
    assert one.quality.considered is not None
    return (
        ratio(z, one.quality.of_points),
        ratio(z, with_considered(one.quality, 1.0).of_points),
        ratio(other.state.object_point[:, 2], other.quality.of_points),
        one.quality.considered.contradiction((0,)).statistic,
    )


def with_focal_length(block: Block, error: float, free: bool) -> Block:
    """The block with a focal length that is wrong, or free."""
    interior = block.system[0]
    assert interior.family.name == INTERIOR_ORIENTATION
    values, is_free = interior.values.copy(), interior.free.copy()
    values[0, 0] += error
    is_free[0, 0] = free
    return replace(block, system=(replace(interior, values=values, free=is_free), *block.system[1:]))


def test_few_trials_tell_a_held_from_a_considered_focal_length() -> None:
    trials = Trials.of(12, CONTROL["five control points"])
    assert trials.over_sigma("held") > 1.1
    assert trials.over_sigma("considered") == pytest.approx(1.0, abs=0.08)
    assert trials.over_sigma("prior") == pytest.approx(1.0, abs=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("control", CONTROL)
def test_errors_in_height_have_their_sigma_unless_the_focal_length_counts_as_exact(control: str) -> None:
    trials = Trials.of(200, CONTROL[control])
    assert 1.1 < trials.over_sigma("held") < 1.4
    assert trials.over_sigma("considered") == pytest.approx(1.0, abs=0.05)
    assert trials.over_sigma("prior") == pytest.approx(1.0, abs=0.05)
    # T has one degree of freedom.
    low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], 200) / 200
    assert low < trials.statistic.mean() < high
    assert int((trials.statistic > stats.chi2.ppf(0.95, 1)).sum()) <= stats.binom.ppf(0.999, 200, 0.05)


@pytest.mark.slow
def test_variance_components_scatter_with_their_degrees_of_freedom() -> None:
    """Attitudes of ten strips of three, each with a bias that is considered, take ten of thirty yaws.

    At the true weights, S⁻¹ (q − r) has the covariance 2 S⁻¹. With the S of the biases held, the variances of
    roll and pitch, and of yaw, would be 1.3 times those stated.
    """
    strips, trials, sigma = 10, 600, 0.02 * DEGREE
    places = tuple(ParameterPlace(INS_STRIP_BIAS, k, c) for k in range(strips) for c in range(3))
    known = ConsideredParameters(places, sigma**2 * np.eye(len(places)))
    adjuster, estimates, traces = Adjuster(AdjustmentOptions(threads=1)), [], np.empty(0)
    for seed in range(trials):
        scene = two_strips(
            strips=strips, images_per_strip=3, points_along=8, points_across=22, noise_seed=seed
        )
        biases = np.random.default_rng((7, seed)).normal(0.0, sigma, (strips, 3))
        system = tuple(
            replace(item, values=item.values + biases) if item.family.name == INS_STRIP_BIAS else item
            for item in scene.block.system
        )
        block = replace(scene.block, system=system, considered=known)
        adjusted = adjuster.adjust(System.of(block, scene.observations, 1), block.approximate_state())
        parts = parts_of(scene.observations)
        sums = PartSums.of(adjusted, parts)
        told = np.flatnonzero(sums.redundancy >= 10.0)
        if seed == 0:
            names = [parts[k].name for k in told]
            of_parts = np.where([parts[k].group == 0 for k in told], sums.redundancy[told], 1.0)
            chosen, considered = tuple(parts[k] for k in told), adjusted.considered
            traces = trace_matrix(adjusted.system, adjusted.solution, chosen, of_parts, considered)
        estimates.append(np.linalg.solve(traces, (sums.squares - sums.redundancy)[told]))
    squares = 0.5 * np.array(estimates) ** 2 / np.diagonal(np.linalg.inv(traces))
    ratio, chance = squares.mean(axis=0), squares.std(axis=0) / np.sqrt(trials)
    assert np.all(np.abs(ratio - 1.0) < stats.norm.isf(5e-4) * chance), dict(zip(names, ratio, strict=True))
    of_attitudes = [k for k, name in enumerate(names) if name.startswith("ins_attitudes")]
    assert len(of_attitudes) == 2
    assert chance[of_attitudes].max() < 0.09, "chance would decide"
