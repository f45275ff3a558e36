"""The compiled kernels against the observation equations in full, which share no code with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.parameters import BORESIGHT, State
from adjust.quality.cofactor import Cofactor, cofactor
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.redundancy import group_residuals
from adjust.result import ObservationStatus
from adjust.solve.design_matrix import (
    DesignMatrix,
    design_matrix,
    full_cofactor,
    full_normals,
    full_solution,
    redundancy_numbers,
    schur_complement,
)
from adjust.solve.factorization import factorize
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import ReducedNormals, reduced_normals, substitute_back
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips, variants
from tests.adjust.solve.dense_normals import dense_matrix

# Of the natural scale of each element: the geometric mean of its two diagonal elements.
RELATIVE = 1e-9


@dataclass(frozen=True, eq=False)
class BothWays:
    system: System
    state: State
    normals: ReducedNormals
    design: DesignMatrix

    @classmethod
    def of(cls, scene: Scene) -> BothWays:
        system = System.of(scene.block, scene.observations)
        state = scene.block.approximate_state()
        return cls(system, state, reduced_normals(system, state), design_matrix(system, state))

    @property
    def exposures(self) -> int:
        return self.design.exposure_columns.size

    @property
    def reduced(self) -> tuple[Floats, Floats]:
        """Reduced matrix and right-hand side without the unknowns of joins, which the full equations lack."""
        matrix = dense_matrix(self.normals)
        rhs = np.concatenate([self.normals.rhs_exposure.ravel(), self.normals.rhs_border])
        kept = self.exposures + self.system.layout.border
        gain = np.linalg.solve(matrix[kept:, kept:], matrix[kept:, :kept]).T
        return matrix[:kept, :kept] - gain @ matrix[kept:, :kept], rhs[:kept] - gain @ rhs[kept:]

    def kernel_cofactor(self) -> Cofactor:
        return cofactor(self.system, Solution(self.state, self.normals, factorize(self.normals), ()))


VARIANTS = variants()


@pytest.fixture(scope="module", params=list(VARIANTS), name="both")
def both_ways(request: pytest.FixtureRequest) -> BothWays:
    return BothWays.of(VARIANTS[request.param])


def assert_equal_on_scale(found: Floats, expected: Floats, scale: Floats) -> None:
    assert np.all(np.abs(found - expected) <= RELATIVE * scale), np.max(np.abs(found - expected) / scale)


def test_reduced_matrix_is_the_schur_complement_of_the_full_normal_equations(both: BothWays) -> None:
    expected, _ = schur_complement(both.design)
    root = np.sqrt(np.diagonal(expected))
    assert_equal_on_scale(both.reduced[0], expected, np.outer(root, root))


def test_reduced_right_hand_side_is_that_of_the_schur_complement(both: BothWays) -> None:
    matrix, expected = schur_complement(both.design)
    found = both.reduced[1]
    # |s_i| ≤ √S_ii |l| by Cauchy–Schwarz.
    scale = np.sqrt(np.diagonal(matrix)) * np.sqrt(both.design.weighted_squares)
    assert_equal_on_scale(found, expected, scale)


def test_weighted_squares_agree(both: BothWays) -> None:
    assert both.normals.weighted_squares == pytest.approx(both.design.weighted_squares, rel=RELATIVE)


def test_diagonal_before_reduction_is_that_of_the_full_normal_equations(both: BothWays) -> None:
    normal, _ = full_normals(both.design)
    found = np.concatenate([both.normals.diagonal_exposure.ravel(), both.normals.diagonal_border])
    found = found[: both.exposures + both.system.layout.border]
    expected = np.diagonal(normal)[: len(found)]
    assert_equal_on_scale(found, expected, expected)


# Joined points have unknowns that the full equations lack.
@pytest.mark.parametrize("name", [name for name, scene in VARIANTS.items() if not scene.plan.distances])
def test_damping_adds_its_part_of_the_diagonal_before_points_are_eliminated(name: str) -> None:
    both = BothWays.of(VARIANTS[name])
    normal, _ = full_normals(both.design)
    normal = normal + 0.3 * np.diag(np.diagonal(normal))
    kept = both.exposures + both.system.layout.border
    gain = np.linalg.solve(normal[kept:, kept:], normal[kept:, :kept])
    expected = normal[:kept, :kept] - normal[:kept, kept:] @ gain
    found = dense_matrix(reduced_normals(both.system, both.state, 0.3))
    root = np.sqrt(np.diagonal(expected))
    assert_equal_on_scale(found, expected, np.outer(root, root))


def test_solution_and_decrement_agree(both: BothWays) -> None:
    cofactors = full_cofactor(both.design)
    expected = full_solution(both.design, cofactors)
    of_exposures, of_border = factorize(both.normals).solve()
    of_points = substitute_back(both.system, both.state, both.normals, of_exposures, of_border)
    active = both.system.active_point
    of_parameters = of_border[: both.system.layout.border]
    found = np.concatenate([of_exposures.ravel(), of_parameters, of_points[active].ravel()])
    # |dx_i| ≤ σ_i |l|.
    scale = np.sqrt(np.diagonal(cofactors)) * np.sqrt(both.design.weighted_squares)
    assert_equal_on_scale(found, expected, scale)
    assert not of_points[~active].any()
    _, rhs = full_normals(both.design)
    decrement = both.normals.eliminated + float(
        np.sum(both.normals.rhs_exposure * of_exposures) + both.normals.rhs_border @ of_border
    )
    assert decrement == pytest.approx(float(rhs @ expected), rel=RELATIVE)


def test_cofactors_of_exposures_and_border_are_blocks_of_the_full_inverse(both: BothWays) -> None:
    expected = full_cofactor(both.design)
    found = both.kernel_cofactor().without_joins(both.system.layout).reduced
    root = np.sqrt(np.diagonal(expected))
    for block, i, j in zip(found.blocks, found.pattern.row, found.pattern.column, strict=True):
        rows, columns = both.design.exposure_columns[i], both.design.exposure_columns[j]
        here = np.ix_(rows, columns)
        assert_equal_on_scale(block, expected[here], np.outer(root[rows], root[columns]))
    border = both.design.border_columns
    exposures = both.design.exposure_columns.ravel()
    assert_equal_on_scale(
        found.border.reshape(len(exposures), -1),
        expected[np.ix_(exposures, border)],
        np.outer(root[exposures], root[border]),
    )
    corner = expected[np.ix_(border, border)]
    assert_equal_on_scale(found.corner, corner, np.outer(root[border], root[border]))
    if len(border):
        inverse = np.linalg.inv(corner)
        root = np.sqrt(np.diagonal(inverse))
        assert_equal_on_scale(1e-3 * found.normal, 1e-3 * inverse, np.outer(root, root))


def test_cofactors_between_joined_points_are_blocks_of_the_full_inverse(both: BothWays) -> None:
    expected = full_cofactor(both.design)
    point, other = both.system.joined
    for found, j, k in zip(both.kernel_cofactor().of_joins, point, other, strict=True):
        rows, columns = both.design.point_columns[j], both.design.point_columns[k]
        scale = np.sqrt(np.outer(np.diagonal(expected)[rows], np.diagonal(expected)[columns]))
        assert_equal_on_scale(found, expected[np.ix_(rows, columns)], scale)


def test_cofactors_of_object_points_are_blocks_of_the_full_inverse(both: BothWays) -> None:
    expected = full_cofactor(both.design)
    found = both.kernel_cofactor().of_points
    for j, columns in enumerate(both.design.point_columns):
        if not both.system.active_point[j]:
            assert np.isnan(found[j]).all()
            continue
        root = np.sqrt(np.diagonal(expected)[columns])
        assert_equal_on_scale(found[j], expected[np.ix_(columns, columns)], np.outer(root, root))


def test_redundancy_numbers_are_the_diagonal_of_the_full_redundancy_matrix(both: BothWays) -> None:
    expected = redundancy_numbers(both.system, both.design, full_cofactor(both.design))
    found = group_residuals(both.system, both.state, both.kernel_cofactor())
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours.redundancy, theirs, rtol=0.0, atol=RELATIVE)


def test_hat_matrices_of_image_points_are_blocks_of_the_full_one(both: BothWays) -> None:
    rows = both.design.matrix.toarray()[: both.design.row_start[1]]
    pairs = rows.reshape(-1, 2, rows.shape[1])
    expected = pairs @ full_cofactor(both.design) @ np.swapaxes(pairs, 1, 2)
    used = both.system.observations.image_points.active
    found = both.kernel_cofactor().hat_of_rays[used]
    np.testing.assert_allclose(found, expected[used][:, [0, 0, 1], [0, 1, 1]], rtol=0.0, atol=RELATIVE)


def test_the_smallest_error_that_is_found_is_that_of_its_own_coordinate() -> None:
    scene = VARIANTS["nothing_free"]
    rays = scene.observations.image_points
    rays = replace(rays, sigma=rays.sigma * [1.0, 1.7])
    both = BothWays.of(replace(scene, observations=replace(scene.observations, image_points=rays)))
    found = group_residuals(both.system, both.state, both.kernel_cofactor())[0]
    kept = found.redundancy > UNCONTROLLED
    assert kept.any(axis=0).all()
    expected = NON_CENTRALITY * rays.sigma / np.sqrt(found.redundancy)
    np.testing.assert_allclose(found.detectable[kept], expected[kept], rtol=1e-9)


def test_redundancy_numbers_sum_up_to_observations_less_unknowns(both: BothWays) -> None:
    found = group_residuals(both.system, both.state, both.kernel_cofactor())
    total = sum(float(np.nansum(item.redundancy)) for item in found)
    assert total == pytest.approx(both.system.redundancy, abs=1e-6)
    assert both.design.unknowns == both.system.unknowns


def test_rays_of_a_point_that_dropped_out_take_no_part() -> None:
    both = BothWays.of(VARIANTS["rejected_rays"])
    rays = both.system.observations.image_points
    inactive = ~both.system.active_point
    assert inactive.sum() == 2
    assert not rays.active[inactive[rays.point]].any()
    assert np.count_nonzero(both.design.matrix.sum(axis=1)) == both.system.observations.count


def test_a_partial_survey_of_a_point_without_rays_takes_no_part() -> None:
    scene = two_strips(free={BORESIGHT: True}, noise_seed=4)
    rays = scene.observations.image_points
    plan_only = scene.observations.others[0].point[scene.plan.control.index("plan")]
    left = replace(scene.observations, image_points=rays.without(rays.point == plan_only))
    result = adjust_block(scene.block, left)
    assert sum(group.redundancy_sum for group in result.groups) == pytest.approx(
        result.test.redundancy, abs=1e-6
    )
    control = result.groups[1]
    assert (control.status[scene.plan.control.index("plan")] == ObservationStatus.NOT_USED).all()


def test_repeated_measurements_of_a_point_in_one_image_count_like_any_two() -> None:
    scene = VARIANTS["nothing_free"]
    rays = scene.observations.image_points
    twice = np.sort(np.concatenate([np.arange(len(rays.image)), [3, 3, 20]]))
    repeated = replace(
        rays,
        image=rays.image[twice],
        point=rays.point[twice],
        xy=rays.xy[twice],
        sigma=rays.sigma[twice],
        active=rays.active[twice],
    )
    both = BothWays.of(replace(scene, observations=replace(scene.observations, image_points=repeated)))
    expected, _ = schur_complement(both.design)
    root = np.sqrt(np.diagonal(expected))
    assert_equal_on_scale(dense_matrix(both.normals), expected, np.outer(root, root))
