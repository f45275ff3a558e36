from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.selection.correlation import total_correlation
from adjust.selection.determinability import entangled_with, own_part, part_of_prior, undetermined
from adjust.selection.linear_estimate import LinearEstimate
from tests.adjust.calibration.designs import random_design


def test_the_own_part_is_what_the_total_correlation_leaves() -> None:
    estimate = LinearEstimate.of(random_design(1).normals).without(3)
    free = estimate.free
    total = total_correlation(estimate.cofactor[np.ix_(free, free)])
    assert own_part(estimate)[free] == pytest.approx(1.0 - total**2, rel=1e-6)
    assert np.isnan(own_part(estimate)[3])


def test_a_parameter_that_nothing_but_its_prior_determines_is_told() -> None:
    design = random_design(2)
    matrix = design.of_parameters.copy()
    matrix[:, 4] *= 1e-3
    estimate = LinearEstimate.of(replace(design, of_parameters=matrix).normals)
    assert part_of_prior(estimate)[4] > 0.999
    assert np.isnan(part_of_prior(estimate)[1])
    assert np.flatnonzero(undetermined(estimate)).tolist() == [4]


def test_parameters_with_nearly_the_same_effect_are_told_with_what_they_are_mixed_up() -> None:
    design = random_design(3, priors=False)
    matrix = design.of_parameters.copy()
    length = np.linalg.norm(matrix, axis=0)
    matrix /= length
    matrix[:, 6] = matrix[:, 1] - 0.8 * matrix[:, 2] + 1e-4 * matrix[:, 6]
    # Units are no part of it.
    matrix *= 10.0 ** np.array([0.0, -4.0, 4.0, 3.0, -3.0, 2.0, 1.0, -1.0])
    estimate = LinearEstimate.of(replace(design, of_parameters=matrix).normals)
    assert np.flatnonzero(undetermined(estimate)).tolist() == [1, 2, 6]
    assert set(entangled_with(estimate, 6).tolist()) == {1, 2}
    assert 6 in entangled_with(estimate, 1).tolist()
    assert not undetermined(estimate.without(2)).any()


def test_of_many_the_three_it_is_mixed_up_with_most_are_told_the_strongest_first() -> None:
    design = random_design(4, priors=False)
    matrix = design.of_parameters / np.linalg.norm(design.of_parameters, axis=0)
    matrix[:, 7] = matrix[:, :5] @ [0.9, -0.6, 2.0, 1.5, 0.7] + 1e-4 * matrix[:, 7]
    estimate = LinearEstimate.of(replace(design, of_parameters=matrix).normals)
    assert entangled_with(estimate, 7).tolist() == [2, 3, 0]
