"""Influence of observations on system parameters: against the full equations, and by moving observations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.observations.gnss_position import GnssPositions
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS
from adjust.quality.parameter_influences import parameter_influences
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.system import SystemSpecification
from adjust.solve.design_matrix import design_matrix, full_cofactor, whitening_matrix
from adjust.solve.system import Observations, System
from tests.adjust.simulate.specifications import small_specification

OPTIONS = AdjustmentOptions(threads=1)
FREE = (BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS)


@pytest.fixture(scope="module")
def flown() -> SimulatedBlock:
    system = SystemSpecification(gnss_shift=(-0.26, 0.12, 0.29), strip_bias=(0.03, 0.03, 0.03))
    return simulate_block(small_specification(system=system))


@pytest.mark.parametrize("correlated", [False, True])
def test_influences_are_those_of_the_full_equations(flown: SimulatedBlock, correlated: bool) -> None:
    times = {"gnss_positions": 30.0} if correlated else {}
    block = flown.block(FREE)
    observations = flown.observations(block, correlation_times=times)
    result = adjust_block(block, observations, OPTIONS)
    columns = np.arange(6)
    system = System.of(block, observations, 1)
    design = design_matrix(system, result.state)
    cofactor = full_cofactor(design)
    found = {item.group.name: item for item in parameter_influences(result, columns)}
    assert set(found) == {group.name for group in observations.others}
    for number, group in enumerate(observations.groups):
        if group.name not in found:
            continue
        rows = design.matrix[design.row_start[number] : design.row_start[number + 1]].toarray()
        whitened = cofactor[design.border_columns[columns]] @ rows.T
        expected = whitened @ whitening_matrix(group.stochastic).toarray()
        derivative = found[group.name].derivative.reshape(len(columns), -1)
        scale = np.abs(expected).max(axis=1)[:, None]
        np.testing.assert_allclose(derivative / scale, expected / scale, atol=1e-5)


def test_a_moved_position_moves_the_parameters_by_its_influence(flown: SimulatedBlock) -> None:
    block = flown.block(FREE)
    observations = flown.observations(block)
    result = adjust_block(block, observations, OPTIONS)
    columns = result.layout.columns[GNSS_SHIFT][0]
    found = {item.group.name: item for item in parameter_influences(result, columns)}
    others = []
    for group in observations.others:
        moved = group
        if isinstance(group, GnssPositions):
            observed = group.observed.copy()
            observed[7] += 0.1 * group.local_from_enu[7][:, 2]
            moved = replace(group, observed=observed)
        others.append(moved)
    again = estimate_block(block, Observations(observations.image_points, tuple(others)), OPTIONS)
    change = again.state.system[GNSS_SHIFT][0] - result.state.system[GNSS_SHIFT][0]
    expected = 0.1 * found["gnss_positions"].derivative[:, 7, 2]
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())
