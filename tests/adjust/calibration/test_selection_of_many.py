"""Many parameters offered: the true ones are kept, hardly a false one, and nothing crashes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats
from adjust.camera.additional.effect import effects, image_error_field
from adjust.options import AdjustmentOptions
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION
from adjust.result import AdjustmentResult
from adjust.selection.correlation import correlation_matrix, total_correlation
from adjust.selection.determinability import PRIOR_ONLY, part_of_prior, undetermined
from adjust.selection.elimination import DEFAULT, PRESETS, Action, Criterion, eliminate
from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.parameter_normals import normals_of_result
from adjust.selection.parameter_selection import adjust_with_selection, columns_of
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from tests.adjust.calibration.self_calibrated import (
    DMC_II_140,
    EAGLE,
    EAST,
    LOW,
    SelfCalibratedBlock,
    dmc_ii_block,
    eagle_test_field,
    lines,
    parameters_of,
)

SELECTION = "bluh:1-12+42-73+81-88"
OFFERED = parameters_of(EAGLE, SELECTION)
#: One or two of each kind: general, scale, shifts and perspective of a CCD image, corner.
TRUE = ("bluh:5", "bluh:9", "bluh:42", "bluh:52", "bluh:61", "bluh:70", "bluh:82")
IS_TRUE: Bools = np.isin(OFFERED.names, TRUE)
NO_TRAJECTORY = ("gnss_positions", "ins_attitudes")
MICROMETRE = 1e-6


@dataclass(frozen=True, eq=False)
class AdjustedField:
    """The test field adjusted with all 52 parameters, and true values of seven that give t = 6."""

    simulated: SimulatedBlock
    result: AdjustmentResult
    true_values: Floats

    @property
    def estimate(self) -> LinearEstimate:
        return LinearEstimate.of(normals_of_result(self.result))


@pytest.fixture(scope="module")
def field() -> AdjustedField:
    simulated = simulate_block(eagle_test_field())
    offered = SelfCalibratedBlock.of(simulated, OFFERED, {})
    block = offered.block()
    result = adjust_block(block, offered.observations(block, NO_TRAJECTORY))
    sigma = np.sqrt(np.diagonal(result.cofactor.reduced.corner))
    return AdjustedField(simulated, result, np.where(IS_TRUE, 6.0 * sigma, 0.0))


@pytest.mark.slow
def test_the_test_field_determines_52_parameters(field: AdjustedField) -> None:
    # An independent program with a block of the same description found a largest correlation of .81.
    cofactor = field.estimate.cofactor
    assert len(OFFERED.names) == 52
    assert np.abs(correlation_matrix(cofactor) - np.eye(52)).max() == pytest.approx(0.81, abs=0.03)
    assert total_correlation(cofactor).max() < 0.98
    assert not undetermined(field.estimate).any()
    largest = field.true_values[IS_TRUE] * effects(OFFERED).largest[IS_TRUE] / MICROMETRE
    assert largest.min() > 0.5
    assert largest.max() < 2.0


@pytest.mark.slow
def test_seven_true_of_52_are_kept_and_hardly_a_false_one(field: AdjustedField) -> None:
    full, rms = field.estimate, effects(OFFERED).rms
    sigma = np.sqrt(np.diagonal(full.cofactor))
    lower = sigma[:, None] * np.linalg.cholesky(full.cofactor / np.outer(sigma, sigma))
    random = np.random.default_rng(52)
    runs, complete, false, effect = 400, 0, 0, [0.0]
    for _ in range(runs):
        change = field.true_values + lower @ random.normal(size=52)
        squares = float(random.chisquare(full.redundancy))
        drawn = replace(
            full,
            normals=replace(
                full.normals,
                rhs=full.normals.normal @ change,
                weighted_squares=squares + float(change @ full.normals.normal @ change),
            ),
            change=change,
            weighted_squares=squares,
        )
        found = eliminate(drawn, np.ones(52, dtype=bool), DEFAULT)
        complete += bool(found.kept[IS_TRUE].all())
        wrong = found.kept & ~IS_TRUE
        false += int(wrong.sum())
        effect += (np.abs(found.estimate.change[wrong]) * rms[wrong] / MICROMETRE).tolist()
    assert complete >= 0.99 * runs
    # Twice the false alarms of 45 tests at 1 %.
    assert false / runs <= 2 * 45 * 0.01
    assert max(effect) < 0.2


@pytest.mark.slow
def test_full_adjustments_select_as_the_linearised_ones_do(field: AdjustedField) -> None:
    true = dict(zip(OFFERED.names, field.true_values, strict=True))
    false = 0
    for seed in (11, 12, 13):
        block_of = SelfCalibratedBlock.of(field.simulated.measured_again(seed), OFFERED, true)
        block = block_of.block()
        observations = block_of.observations(block, NO_TRAJECTORY)
        selected = adjust_with_selection(block, observations, AdjustmentOptions(), DEFAULT)
        assert selected.elimination is not None
        linear, kept = selected.elimination.estimate, selected.elimination.kept
        assert kept[IS_TRUE].all()
        false += int((kept & ~IS_TRUE).sum())
        # Nothing is adjusted between the first and the last adjustment; they agree all the same.
        again = LinearEstimate.of(normals_of_result(selected.result))
        sigma = np.sqrt(np.diagonal(again.cofactor))
        assert np.abs((linear.change[kept] - again.change) / sigma).max() < 1e-3
        assert linear.weighted_squares == pytest.approx(again.weighted_squares, rel=1e-6)
        assert linear.redundancy == again.redundancy
        assert np.sqrt(np.diagonal(linear.cofactor))[kept] == pytest.approx(sigma, rel=1e-3)
        error = (again.change - field.true_values[kept]) / (again.sigma0 * sigma)
        assert np.abs(error).max() < 4.5
    assert false <= 6


@pytest.mark.slow
def test_a_smooth_error_of_a_third_of_a_micrometre_needs_about_four_of_twelve() -> None:
    # DMC II: one CCD, systematic image errors of 0.32 µm on average, 4 of 12 parameters survive on average.
    error, offered = parameters_of(DMC_II_140, "legendre(3)"), parameters_of(DMC_II_140, "bluh:1-12")
    kept = []
    for seed in range(12):
        simulated = simulate_block(dmc_ii_block(seed))
        values = np.random.default_rng(500 + seed).normal(size=len(error.names))
        values *= 0.32 * MICROMETRE / image_error_field(error, values).rms
        block_of = SelfCalibratedBlock(simulated, error, values, offered)
        block = block_of.block()
        result = adjust_block(block, block_of.observations(block))
        estimate = LinearEstimate.of(normals_of_result(result))
        kept.append(int(eliminate(estimate, np.ones(12, dtype=bool), DEFAULT).kept.sum()))
    assert 3.0 <= np.mean(kept) <= 6.0


# Too much asked of too little: 20 images of one height, two lines to and fro, five control points.


def small_block(prior_um: float | None) -> tuple[SelfCalibratedBlock, dict[str, object]]:
    simulated = simulate_block(
        eagle_test_field(
            flight=(lines("E", LOW, EAST, (10, 10)),),
            points=PointSpecification(count=60, detection=0.4),
            survey=(SurveyLayout("perimeter", control=5, count=5),),
        )
    )
    return SelfCalibratedBlock.of(simulated, OFFERED, {}), {"without": NO_TRAJECTORY, "prior_um": prior_um}


@pytest.mark.parametrize("preset", sorted(PRESETS))
@pytest.mark.parametrize("prior_um", [None, 3.0])
def test_52_parameters_of_20_images_of_one_height_end_in_a_sound_result(
    prior_um: float | None, preset: str
) -> None:
    offered, switches = small_block(prior_um)
    block = offered.block((INTERIOR_ORIENTATION,))
    assert len(block.images) == 20
    observations = offered.observations(block, **switches)  # type: ignore[arg-type]
    selected = adjust_with_selection(block, observations, AdjustmentOptions(), PRESETS[preset])
    assert selected.elimination is not None
    decisions = selected.elimination.decisions
    # Every one of the 52 has a last word with a reason.
    last = {item.name: item for item in decisions}
    assert set(last) == set(OFFERED.names)
    assert all(item.reason for item in decisions)
    hopeless = [item for item in decisions if item.criterion == Criterion.DETERMINABILITY]
    if prior_um is None:
        assert hopeless
        assert all(item.action == Action.ELIMINATED for item in hopeless)
        assert all("not determinable" in item.reason for item in hopeless)
    assert np.isfinite(selected.full.cofactor).all()
    result = selected.result
    candidates = columns_of(result.layout, ADDITIONAL_PARAMETERS)
    estimate = LinearEstimate.of(normals_of_result(result))
    assert not (undetermined(estimate) & candidates).any()
    # The truth is zero everywhere: what remains is as far from it as its standard deviation allows. Of two
    # observations too many, σ0 is known to nobody.
    sigma = np.sqrt(np.diagonal(estimate.cofactor))[candidates]
    assert np.all(np.abs(estimate.change[candidates]) < 5.0 * max(1.0, estimate.sigma0) * sigma)
    if preset == "default":
        assert candidates.sum() <= 3


def test_with_a_prior_nothing_is_undetermined_and_its_part_is_known() -> None:
    offered, switches = small_block(3.0)
    block = offered.block()
    result = adjust_block(block, offered.observations(block, **switches))  # type: ignore[arg-type]
    estimate = LinearEstimate.of(normals_of_result(result))
    part = part_of_prior(estimate)
    assert estimate.free.all()
    assert np.all((part > 0.0) & (part < 1.0 + 1e-9))
    assert part.max() > 0.5
    assert (undetermined(estimate) == (part > PRIOR_ONLY)).all()
