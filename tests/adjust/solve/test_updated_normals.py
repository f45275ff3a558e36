"""Normal equations updated for the object points that changed equal those made from all observations."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Bools
from adjust.errors import DatumDefectError
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION
from adjust.quality.cofactor import cofactor, of_other_rays
from adjust.solve.factorization import factorize
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import ReducedNormals, reduced_normals
from adjust.solve.system import Observations, System
from adjust.solve.updated_normals import changed_points, updated_normals
from tests.adjust.random_scenes import drawn
from tests.adjust.scenes import Scene, variants
from tests.adjust.solve.dense_normals import dense_matrix

VARIANTS = variants()


@pytest.fixture(scope="module", params=list(VARIANTS), name="scene")
def every_scene(request: pytest.FixtureRequest) -> Scene:
    return VARIANTS[request.param]


def without_some(observations: Observations, seed: int) -> Observations:
    """Some image points, and one observation of every other group, rejected."""
    random = np.random.default_rng(seed)

    def some(count: int, rejected: int) -> Bools:
        mask = np.zeros(count, dtype=bool)
        mask[random.choice(count, min(rejected, count - 1), replace=False)] = True
        return mask

    rays = observations.image_points
    return Observations(
        rays.without(some(len(rays.image), 5)),
        tuple(group.without(some(len(group.event), 1)) for group in observations.others),
    )


def assert_same(found: ReducedNormals, expected: ReducedNormals, system: System) -> None:
    """To 1e-9 of the natural scale of each element, which rounding of what was taken off cannot reach."""
    matrix = dense_matrix(expected)
    root = np.sqrt(np.diagonal(matrix))
    assert np.all(np.abs(dense_matrix(found) - matrix) <= 1e-9 * np.outer(root, root))
    squares = np.sqrt(expected.weighted_squares)
    for name in ("rhs_exposure", "rhs_border"):
        scale = np.sqrt(getattr(expected, name.replace("rhs", "diagonal"))) * squares
        assert np.all(np.abs(getattr(found, name) - getattr(expected, name)) <= 1e-9 * scale), name
    for name in ("diagonal_exposure", "diagonal_border", "weighted_squares", "eliminated"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=1e-9, atol=1e-9 * squares**2
        )
    active = system.active_point
    np.testing.assert_allclose(found.point_factor[active], expected.point_factor[active], rtol=1e-9)
    np.testing.assert_allclose(found.point_rhs[active], expected.point_rhs[active], rtol=1e-9, atol=1e-6)


def test_less_and_more_observations_give_the_equations_of_those_that_are_left(scene: Scene) -> None:
    system = System.of(scene.block, scene.observations)
    fewer = system.remaining(without_some(scene.observations, 3))
    state = scene.block.approximate_state()
    every, few = reduced_normals(system, state), reduced_normals(fewer, state)
    assert_same(updated_normals(system, every, fewer, state), few, fewer)
    assert_same(updated_normals(fewer, few, system, state), every, system)


def test_nothing_else_of_the_equations_changes() -> None:
    """A field that is added to the normal equations has to be updated, too."""
    assert {item.name for item in fields(ReducedNormals)} == {
        "blocking", "blocks", "border", "corner", "rhs_exposure", "rhs_border", "diagonal_exposure",
        "diagonal_border", "point_factor", "point_rhs", "couplings", "weighted_squares", "eliminated",
    }  # fmt: skip


def test_cofactors_of_the_points_that_changed_are_those_of_their_rays(scene: Scene) -> None:
    """With the same cofactors of the orientations: equal for these points, untouched for the others."""
    system = System.of(scene.block, scene.observations)
    fewer = system.remaining(without_some(scene.observations, 4))
    state = scene.block.approximate_state()
    solutions = [
        Solution(state, normals, factorize(normals), ())
        for normals in (reduced_normals(system, state), reduced_normals(fewer, state))
    ]
    before, after = cofactor(system, solutions[0]), cofactor(fewer, solutions[1])
    points = changed_points(system.observations, fewer.observations, len(system.active_point))
    found = of_other_rays(replace(before, reduced=after.reduced), fewer, solutions[1], points)
    kept = points & fewer.active_point
    np.testing.assert_allclose(found.of_points[kept], after.of_points[kept], rtol=1e-9)
    rays = points[fewer.observations.image_points.point]
    np.testing.assert_allclose(found.hat_of_rays[rays], after.hat_of_rays[rays], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found.hat_of_rays[~rays], before.hat_of_rays[~rays])


def test_a_basis_that_is_known_gives_what_computing_it_each_time_gives(scene: Scene) -> None:
    """Also of parameters with values; where the principal point has moved the basis is computed again."""
    state = scene.block.approximate_state()
    rays = scene.observations.image_points
    known = rays.with_known_basis(state)
    if rays.self_calibration is None or not rays.self_calibration.is_linear:
        assert known is rays
        return
    assert known.known is not None
    values = state.system[ADDITIONAL_PARAMETERS]
    with_values = replace(state, system={**state.system, ADDITIONAL_PARAMETERS: values + 1e-3})
    moved = {name: array.copy() for name, array in with_values.system.items()}
    moved[INTERIOR_ORIENTATION][:, 1:] += 1e-5
    for at in (state, with_values, replace(state, system=moved)):
        one, other = known.linearize(at), rays.linearize(at)
        np.testing.assert_allclose(one.misclosure, other.misclosure, rtol=0.0, atol=1e-15)
        for term, same in zip(one.terms, other.terms, strict=True):
            np.testing.assert_allclose(term.jacobian, same.jacobian, rtol=1e-12)


def test_a_rejection_that_leaves_parameters_undetermined_names_them() -> None:
    """Of an earlier state's matrix more is taken off than it has: it is not even positive semidefinite."""
    one = drawn(46)
    options = replace(one.options, reference_variance="a_posteriori", critical_value=2.2)
    with pytest.raises(DatumDefectError, match="boresight"):
        adjust_block(one.block, one.observations, options)
