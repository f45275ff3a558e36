"""Blocks whose datum is that of their approximate values, against the dense bordered equations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.geometry import rotation
from adjust.geometry.earth import CartesianFrame
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION, InnerConstraints, State
from adjust.quality.cofactor import Cofactor, cofactor
from adjust.quality.model_alternatives import ObservationAlternative, alternative_tests
from adjust.quality.parameter_influences import parameter_influences
from adjust.quality.redundancy import group_residuals
from adjust.quality.s_transformation import with_inner_constraints
from adjust.result import AdjustmentResult
from adjust.selection.parameter_normals import normals_at, normals_of_result
from adjust.selection.readjustment import Readjustment
from adjust.solve.datum import DATUM_DIRECTIONS
from adjust.solve.design_matrix import DesignMatrix, design_matrix, full_normals, redundancy_numbers
from adjust.solve.factorization import factorize
from adjust.solve.free_network import OpenMovements, open_movements
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.gauss_newton import Solution, iterate
from adjust.solve.normal_equations import ReducedNormals, reduced_normals, substitute_back
from adjust.solve.system import Observations, System
from tests.adjust.scenes import Scene, two_strips, with_rejected_rays

RELATIVE = 1e-9
CHOICES: tuple[InnerConstraints, ...] = get_args(InnerConstraints)
NOTHING: dict[str, object] = {"control": (), "gnss": False, "ins": False}
# On the curved earth heights notice a shift by so little that equality to 1e-9 could not be asked for.
HEIGHTS: dict[str, object] = {**NOTHING, "control": ("height",) * 5, "frame": "cartesian"}
# What is outside, how many directions it leaves, and which.
BLOCKS: dict[str, tuple[dict[str, object], int]] = {
    "nothing": (NOTHING, 7),
    "nothing, focal length free": ({**NOTHING, "free": {INTERIOR_ORIENTATION: [[True, False, False]]}}, 7),
    "nothing, two cameras": ({**NOTHING, "cameras": 2}, 7),
    "nothing, additional parameters": ({**NOTHING, "additional": True}, 7),
    "heights": (HEIGHTS, 3),
    "three heights": ({**HEIGHTS, "control": ("height",) * 3}, 4),
    "one point": ({**NOTHING, "control": ("full",)}, 4),
    "two points": ({**NOTHING, "control": ("full", "full")}, 1),
    "attitudes": ({"control": (), "gnss": False}, 4),
    "attitudes and boresight": ({"control": (), "gnss": False, "free": {BORESIGHT: True}}, 4),
    "attitudes, correlated over time": ({"control": (), "gnss": False, "ins_correlation_s": 20.0}, 4),
    "distances": ({**NOTHING, "distances": 6}, 6),
    "distances, focal length free": (
        {**NOTHING, "distances": 6, "free": {INTERIOR_ORIENTATION: [[True, False, False]]}},
        6,
    ),
    "distances and attitudes": ({"control": (), "gnss": False, "distances": 3}, 3),
    "positions with a free shift": ({"control": (), "ins": False, "free": {GNSS_SHIFT: True}}, 3),
}

# Every choice of the constrained unknowns for the first block, one after the other for the rest.
CASES = [
    *(("nothing", chosen) for chosen in CHOICES),
    *((block, CHOICES[number % 3]) for number, block in enumerate(BLOCKS) if block != "nothing"),
]


def scene_of(block: str, **switches: object) -> Scene:
    return two_strips(**{"noise_seed": 21, "start_seed": 22, **BLOCKS[block][0], **switches})


@dataclass(frozen=True, eq=False)
class BothWays:
    """One linearisation of a free network: by our way, and as dense equations with a border."""

    system: System
    state: State
    normals: ReducedNormals
    movements: OpenMovements
    design: DesignMatrix

    @classmethod
    def of(cls, scene: Scene, chosen: InnerConstraints) -> BothWays:
        system = System.of(scene.block, scene.observations, inner_constraints=chosen)
        state = scene.block.approximate_state()
        normals = reduced_normals(system, state)
        movements = open_movements(system, state, normals)
        assert movements is not None
        return cls(system, state, normals, movements, design_matrix(system, state))

    def stacked(self, vectors: FullVectors) -> Floats:
        """Vectors (u, d) in the order of the design matrix."""
        d, active = vectors.count, self.system.active_point
        of_parameters = vectors.of_border[: self.system.layout.border]
        parts = (vectors.of_exposures, of_parameters, vectors.of_points[active])
        return np.concatenate([part.reshape(-1, d) for part in parts])

    def bordered(self) -> tuple[Floats, Floats]:
        """Solution (u,) and cofactor matrix (u, u) of the inner constraints from the dense border."""
        normal, rhs = full_normals(self.design)
        scale = 1.0 / np.sqrt(np.diagonal(normal))
        chosen = scale[:, None] * self.stacked(self.movements.selected)
        # Equal sizes in matrix and border; each column of the border may be multiplied by anything.
        chosen = chosen / np.linalg.norm(chosen, axis=0)
        d = chosen.shape[1]
        matrix = np.block([[scale[:, None] * normal * scale, chosen], [chosen.T, np.zeros((d, d))]])
        inverse = np.linalg.inv(matrix)[: len(rhs), : len(rhs)] * scale[:, None] * scale
        solution = np.linalg.solve(matrix, np.concatenate([scale * rhs, np.zeros(d)]))[: len(rhs)]
        return scale * solution, 0.5 * (inverse + inverse.T)

    def solution(self) -> Solution:
        held = self.movements.held(self.normals)
        return Solution(self.state, self.normals, factorize(held), (), movements=self.movements)

    def cofactor(self) -> Cofactor:
        solution = self.solution()
        found = with_inner_constraints(self.system, solution, cofactor(self.system, solution))
        return found.without_joins(self.system.layout)


@pytest.fixture(scope="module", params=CASES, ids=str)
def both(request: pytest.FixtureRequest) -> BothWays:
    block, chosen = request.param
    return BothWays.of(scene_of(block), chosen)


def test_influences_and_effects_on_parameters_are_those_in_its_datum() -> None:
    """A shift that goes with the block: what a position adds to it when the block is adjusted again."""
    scene, number = scene_of("positions with a free shift"), 3
    options = AdjustmentOptions(free_network="object_points")
    positions = next(group for group in scene.observations.others if isinstance(group, GnssPositions))
    change = np.zeros(positions.observed.shape)
    change[number] = 0.03, -0.02, 0.05
    observed = positions.observed + np.einsum("nij,nj->ni", positions.local_from_enu, change)
    moved = replace(scene.observations, others=(replace(positions, observed=observed),))
    before, after = (adjust_block(scene.block, one, options) for one in (scene.observations, moved))
    expected = after.state.system[GNSS_SHIFT][0] - before.state.system[GNSS_SHIFT][0]
    (found,) = parameter_influences(before, before.layout.columns[GNSS_SHIFT][0])
    np.testing.assert_allclose(np.einsum("knm,nm->k", found.derivative, change), expected, atol=3e-5)
    tests = alternative_tests(
        before.system, before.solution, [ObservationAlternative("gnss_positions", change)]
    )
    np.testing.assert_allclose(tests.effect[:, 0], expected, atol=3e-5)
    assert np.abs(expected).min() > 5e-3


@pytest.mark.parametrize("block", BLOCKS)
def test_as_many_movements_are_open_as_the_observations_leave(block: str) -> None:
    assert BothWays.of(scene_of(block), "object_points").movements.defect == BLOCKS[block][1]


def test_no_observation_notices_the_open_movements(both: BothWays) -> None:
    normal, _ = full_normals(both.design)
    g = both.stacked(both.movements.vectors)
    assert np.all(np.abs(normal @ g) <= 1e-13 * (np.abs(normal) @ np.abs(g)).max(axis=0))


def test_the_chosen_rows_of_the_open_movements_are_orthonormal(both: BothWays) -> None:
    chosen = both.stacked(both.movements.selected)
    np.testing.assert_allclose(chosen.T @ chosen, np.eye(both.movements.defect), atol=1e-9)


def test_cofactors_are_those_of_the_dense_bordered_equations(both: BothWays) -> None:
    _, expected = both.bordered()
    found = both.cofactor()
    root, design = np.sqrt(np.diagonal(expected)), both.design

    def assert_equal(block: Floats, rows: object, columns: object) -> None:
        scale = np.outer(root[rows], root[columns])  # type: ignore[index]
        difference = np.abs(block - expected[np.ix_(rows, columns)])  # type: ignore[arg-type]
        assert np.all(difference <= RELATIVE * scale), np.max(difference / scale)

    reduced = found.reduced
    for block, i, j in zip(reduced.blocks, reduced.pattern.row, reduced.pattern.column, strict=True):
        assert_equal(block, design.exposure_columns[i], design.exposure_columns[j])
    exposures = design.exposure_columns.ravel()
    assert_equal(reduced.border.reshape(len(exposures), -1), exposures, design.border_columns)
    assert_equal(reduced.corner, design.border_columns, design.border_columns)
    for block, columns in zip(found.of_points, design.point_columns, strict=True):
        assert_equal(block, columns, columns)


def test_a_step_is_that_of_the_dense_bordered_equations(both: BothWays) -> None:
    expected, cofactors = both.bordered()
    of_exposures, of_border = both.solution().factorization.solve()
    of_points = substitute_back(both.system, both.state, both.normals, of_exposures, of_border)
    added = both.movements.towards_approximate_values(both.system, both.state, of_exposures, of_points)
    found = FullVectors(
        (of_exposures + added[0])[:, :, None],
        (of_border + added[1])[:, None],
        (of_points + added[2])[:, :, None],
    )
    scale = np.sqrt(np.diagonal(cofactors) * both.design.weighted_squares)
    assert np.all(np.abs(both.stacked(found)[:, 0] - expected) <= RELATIVE * scale)


def test_redundancy_numbers_are_those_of_the_dense_equations_and_sum_up(both: BothWays) -> None:
    _, cofactors = both.bordered()
    expected = redundancy_numbers(both.system, both.design, cofactors)
    solution = both.solution()
    quality = cofactor(both.system, solution)
    in_both_datums = (quality, with_inner_constraints(both.system, solution, quality))
    for datum in in_both_datums:
        found = group_residuals(both.system, both.state, datum)
        for ours, theirs in zip(found, expected, strict=True):
            np.testing.assert_allclose(ours.redundancy, theirs, rtol=0.0, atol=1e-8)
        total = sum(float(np.nansum(item.redundancy)) for item in found)
        assert total == pytest.approx(both.system.redundancy + both.movements.defect, abs=1e-6)


def test_solutions_for_other_right_hand_sides_fulfil_the_full_equations(both: BothWays) -> None:
    normal, _ = full_normals(both.design)
    random = np.random.default_rng(5)
    n, g, m = both.system.layout.events, both.system.layout.border, both.system.layout.points
    joins = both.system.border - g
    x = FullVectors(*(random.normal(size=(*shape, 2)) for shape in ((n, 6), (g + joins,), (m, 3))))
    # N maps onto vectors without a part along G, whatever x is; so N (solution of N x) = N x.
    product = normal @ both.stacked(x)
    split = np.split(product, [6 * n, 6 * n + g])
    of_border = np.concatenate([split[1], np.zeros((joins, 2))])
    rhs = FullVectors(split[0].reshape(n, 6, 2), of_border, split[2].reshape(m, 3, 2))
    found = both.stacked(solve_full(both.system, both.state, both.solution().factorization, rhs))
    # |N x|_i ≤ √N_ii |A x|.
    scale = np.outer(
        np.sqrt(np.diagonal(normal)), np.linalg.norm(both.design.matrix @ both.stacked(x), axis=0)
    )
    assert np.all(np.abs(normal @ found - product) <= RELATIVE * scale)


def test_the_s_transformation_is_idempotent(both: BothWays) -> None:
    g, chosen = both.stacked(both.movements.vectors), both.stacked(both.movements.selected)
    s = np.eye(len(g)) - g @ np.linalg.solve(chosen.T @ g, chosen.T)
    scale = np.sqrt(np.diagonal(full_normals(both.design)[0]))
    s = scale[:, None] * s / scale
    np.testing.assert_allclose(s @ s, s, atol=1e-9 * np.abs(s).max())


def test_rejected_rays_and_dropped_points_take_no_part_in_the_datum() -> None:
    scene = with_rejected_rays(scene_of("nothing"))
    mixed = BothWays.of(scene, "object_points")
    inactive = ~mixed.system.active_point
    assert inactive.sum() == 2
    assert not mixed.movements.vectors.of_points[inactive].any()
    _, expected = mixed.bordered()
    found = mixed.cofactor().of_points
    for j, columns in enumerate(mixed.design.point_columns):
        if not inactive[j]:
            root = np.sqrt(np.diagonal(expected)[columns])
            block = expected[np.ix_(columns, columns)]
            assert np.all(np.abs(found[j] - block) <= RELATIVE * np.outer(root, root))


# The adjustment as a whole.


@pytest.mark.parametrize(("sigma_m", "rays_m"), [(0.03, 2e-6), (1e-4, 2e-5), (1e-3, 2e-4)])
def test_heights_on_the_ellipsoid_leave_what_heights_above_a_plane_leave(
    sigma_m: float, rays_m: float
) -> None:
    """An ellipsoid is not curved alike in all directions, so heights notice a rotation about the vertical."""
    scene = scene_of("heights", frame="topocentric", sigma_control_m=sigma_m, sigma_image_m=rays_m)
    both = BothWays.of(scene, "object_points")
    assert both.movements.defect == 3
    # Less than a millionth of σ for a decimetre in each point, with heights of 3 cm.
    noticed = np.linalg.norm(both.design.matrix @ both.stacked(both.movements.vectors), axis=0)
    assert np.all(noticed < 1e-6 * 0.03 / sigma_m)
    if sigma_m < 0.03:
        assert adjusted(scene).solution.defect == 3
        return
    _, expected = both.bordered()
    for block, columns in zip(both.cofactor().of_points, both.design.point_columns, strict=True):
        root = np.sqrt(np.diagonal(expected)[columns])
        assert np.all(np.abs(block - expected[np.ix_(columns, columns)]) <= 1e-5 * np.outer(root, root))


def of_weight(scene: Scene, factor: float, group: str) -> Scene:
    """The same block with other standard deviations of a group of observations."""
    others = tuple(
        item.rescaled(np.full((len(item.event), 1), factor)) if item.name == group else item
        for item in scene.observations.others
    )
    return replace(scene, observations=replace(scene.observations, others=others))


@pytest.mark.parametrize(
    ("switches", "group", "factor", "defect"),
    [
        ({"gnss": True}, "gnss_positions", 1e3, 0),
        ({"gnss": True}, "gnss_positions", 1e4, 7),
        ({"gnss": True}, "gnss_positions", 1e7, 7),
        ({"gnss": True, "ins": True}, "gnss_positions", 1e3, 0),
        ({"gnss": True, "ins": True}, "gnss_positions", 1e5, 4),
        ({"control": ("full",) * 4}, "control_points", 3e3, 0),
        ({"control": ("full",) * 4}, "control_points", 1e4, 7),
        ({"ins": True}, "ins_attitudes", 1e5, 7),
        ({"distances": 6}, "distances", 1e7, 7),
    ],
    ids=str,
)
def test_observations_of_little_weight_determine_all_that_they_know_or_nothing(
    switches: dict[str, object], group: str, factor: float, defect: int
) -> None:
    """Positions of 500 m left some of the movements open: the iteration did not end, or σ were wrong."""
    scene = of_weight(scene_of("nothing", **switches), factor, group)
    found = adjusted(scene)
    assert found.solution.defect == defect
    others = tuple(item for item in scene.observations.others if item.name != group)
    without = replace(scene, observations=replace(scene.observations, others=others))
    expected = adjusted(without) if defect else adjusted(scene, None)
    sigma = np.sqrt(np.diagonal(expected.cofactor.of_points, axis1=1, axis2=2))
    difference = found.cofactor.of_points - expected.cofactor.of_points
    assert np.nanmax(np.abs(difference) / (sigma[:, :, None] * sigma[:, None, :])) < 1e-5
    assert np.nanmax(np.abs(found.state.object_point - expected.state.object_point) / sigma) < 1e-3


def test_little_and_usual_weights_meet() -> None:
    """Heights of 30 m leave what heights of 3 cm leave."""
    both = BothWays.of(of_weight(scene_of("heights"), 1e3, "control_points"), "object_points")
    assert both.movements.defect == 3
    _, expected = both.bordered()
    for block, columns in zip(both.cofactor().of_points, both.design.point_columns, strict=True):
        root = np.sqrt(np.diagonal(expected)[columns])
        assert np.all(np.abs(block - expected[np.ix_(columns, columns)]) <= 1e-5 * np.outer(root, root))


def adjusted(
    scene: Scene, chosen: InnerConstraints | None = "object_points", **options: object
) -> AdjustmentResult:
    return adjust_block(
        scene.block,
        scene.observations,
        AdjustmentOptions(free_network=chosen, **options),  # type: ignore[arg-type]
    )


def trace_of_points(result: AdjustmentResult) -> float:
    return float(np.nansum(np.trace(result.cofactor.of_points, axis1=1, axis2=2)))


def with_datum_points(scene: Scene) -> Scene:
    """A minimal datum: a point in x, y, z, one in x, y and one in height, at their approximate values."""
    points = scene.block.object_point
    far = [int(np.argmin(points @ direction)) for direction in ([1.0, 1.0, 0.0], [-1.0, -1.0, 0.0])]
    far.append(int(np.argmin(points @ np.array([1.0, -1.0, 0.0]))))
    present = np.array([[True, True, True], [True, True, True], [False, False, True]])
    weights = StochasticModel.from_sigma(np.where(present, 1e-3, np.nan))
    given = np.where(present[:, :2].all(axis=1)[:, None], points[far], np.nan)
    control = ControlPoints(np.array(far), given, points[far, 2], scene.block.frame, weights)
    observations = Observations(scene.observations.image_points, (*scene.observations.others, control))
    return replace(scene, observations=observations)


@pytest.mark.parametrize(("block", "chosen"), CASES)
def test_corrections_to_the_approximate_values_keep_the_inner_constraints(
    block: str, chosen: InnerConstraints
) -> None:
    scene = scene_of(block)
    result = adjusted(scene, chosen)
    system = System.of(scene.block, scene.observations, inner_constraints=chosen)
    movements = open_movements(system, result.state, reduced_normals(system, result.state))
    assert movements is not None
    selected = movements.selected
    found = np.einsum(
        "nid,ni->d",
        selected.of_exposures[:, :3],
        result.state.projection_centre - scene.block.projection_centre,
    ) + np.einsum("mid,mi->d", selected.of_points, result.state.object_point - scene.block.object_point)
    # Of corrections of metres.
    assert np.abs(found).max() < 1e-7
    assert result.free_network is not None
    assert result.free_network.defect == movements.defect
    assert result.test.redundancy == system.redundancy + movements.defect


def test_no_small_movement_of_the_block_brings_it_closer_to_the_approximate_values() -> None:
    scene = scene_of("nothing", frame="cartesian")
    points, given = adjusted(scene).state.object_point, scene.block.object_point
    least = np.sum((points - given) ** 2)
    centred = points - points.mean(axis=0)
    for step in (1e-4, -1e-4):
        for axis in np.eye(3):
            assert np.sum((points + step * axis - given) ** 2) > least
            turned = points + 1e-3 * step * np.cross(axis, centred)
            assert np.sum((turned - given) ** 2) > least
        assert np.sum((points + 1e-3 * step * centred - given) ** 2) > least


def test_a_block_that_begins_turned_and_moved_as_a_whole_ends_in_the_same_datum() -> None:
    """Its residuals are at their end from the first step on."""
    scene = scene_of("nothing")
    system = System.of(scene.block, scene.observations, inner_constraints="both")
    end = iterate(system, scene.block.approximate_state(), 20).state
    turn = rotation.exp(np.array([[0.05, -0.1, 0.3]]))[0]
    moved = replace(
        end,
        projection_centre=1.1 * end.projection_centre @ turn.T + [300.0, 200.0, 50.0],
        local_from_camera=turn @ end.local_from_camera,
        object_point=1.1 * end.object_point @ turn.T + [300.0, 200.0, 50.0],
    )
    found = iterate(system, moved, 20).state
    np.testing.assert_allclose(found.projection_centre, end.projection_centre, atol=1e-4)
    np.testing.assert_allclose(found.object_point, end.object_point, atol=1e-4)


@pytest.mark.parametrize("block", ["nothing", "heights", "one point", "attitudes"])
def test_residuals_and_their_statistics_do_not_depend_on_the_datum(block: str) -> None:
    scene = scene_of(block, frame="cartesian")
    results = [adjusted(scene, chosen) for chosen in CHOICES]
    first = results[0]
    for other in results[1:]:
        assert other.test.weighted_squares == pytest.approx(first.test.weighted_squares, rel=1e-10)
        for a, b in zip(first.groups, other.groups, strict=True):
            np.testing.assert_allclose(a.residual / a.sigma, b.residual / b.sigma, atol=1e-6)
            np.testing.assert_allclose(a.redundancy, b.redundancy, atol=1e-8)
            np.testing.assert_allclose(a.standardized, b.standardized, atol=1e-5)


def test_a_minimal_datum_has_the_same_residuals_and_redundancy_numbers() -> None:
    scene = scene_of("nothing", frame="cartesian")
    free, held = adjusted(scene), adjusted(with_datum_points(scene), None)
    assert held.test.redundancy == free.test.redundancy
    a, b = free.groups[0], held.groups[0]
    np.testing.assert_allclose(a.residual, b.residual, atol=1e-6 * a.sigma.max())
    np.testing.assert_allclose(a.redundancy, b.redundancy, atol=1e-7)


def test_object_points_have_the_least_variance_in_the_datum_of_object_points() -> None:
    scene = scene_of("nothing")
    least = trace_of_points(adjusted(scene, "object_points"))
    assert least < trace_of_points(adjusted(scene, "both"))
    assert least < trace_of_points(adjusted(scene, "projection_centres"))
    assert least < 0.9 * trace_of_points(adjusted(with_datum_points(scene), None))


def test_centres_have_the_least_variance_in_the_datum_of_projection_centres() -> None:
    scene = scene_of("nothing")

    def of_centres(chosen: InnerConstraints) -> float:
        blocks = adjusted(scene, chosen).cofactor.reduced.of_exposures[:, :3, :3]
        return float(np.trace(blocks, axis1=1, axis2=2).sum())

    least = of_centres("projection_centres")
    assert all(least < of_centres(chosen) for chosen in ("object_points", "both"))


def ratio_of_bases(result: AdjustmentResult, images: tuple[int, int, int]) -> tuple[float, float]:
    """Log of the ratio of the bases a–b and b–c, which no similarity changes, and its σ."""
    a, b, c = images
    centres = result.state.projection_centre
    one, two = centres[b] - centres[a], centres[c] - centres[b]
    of_one, of_two = one / (one @ one), two / (two @ two)
    gradient = {a: -of_one, b: of_one + of_two, c: -of_two}
    reduced = result.cofactor.reduced
    blocks = {
        (int(i), int(j)): block[:3, :3]
        for block, i, j in zip(reduced.blocks, reduced.pattern.row, reduced.pattern.column, strict=True)
    }
    variance = sum(
        gradient[i] @ (blocks[i, j] if i <= j else blocks[j, i].T) @ gradient[j]
        for i in images
        for j in images
    )
    value = np.log(np.linalg.norm(one) / np.linalg.norm(two))
    return float(value), float(np.sqrt(variance))


def test_ratios_of_distances_and_their_sigma_do_not_depend_on_the_datum() -> None:
    scene = scene_of("nothing", frame="cartesian")
    results = [adjusted(scene, chosen) for chosen in CHOICES]
    results.append(adjusted(with_datum_points(scene), None))
    found = np.array([ratio_of_bases(result, (0, 1, 2)) for result in results])
    np.testing.assert_allclose(found[:, 0], found[0, 0], atol=1e-5 * found[0, 1])
    np.testing.assert_allclose(found[:, 1], found[0, 1], rtol=1e-7)
    # It is a small number of its own, no rounding.
    assert 1e-4 < found[0, 1] < 1e-2


def test_the_directions_are_named() -> None:
    def names(block: str) -> tuple[str, ...]:
        free = adjusted(scene_of(block)).free_network
        assert free is not None
        return tuple(str(direction) for direction in free.directions)

    assert names("nothing") == DATUM_DIRECTIONS
    assert names("heights") == ("shift in x", "shift in y", "rotation about z")
    assert names("attitudes") == ("shift in x", "shift in y", "shift in z", "scale")
    assert names("positions with a free shift") == tuple(
        f"shift in {axis} together with gnss_shift_{axis} of flight_0" for axis in "xyz"
    )
    assert names("three heights")[-1] == "movement that combines scale and shift in z"
    assert "rotation about x" in names("two points")[0]


def test_where_nothing_is_open_the_adjustment_is_an_ordinary_one() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    free, ordinary = adjusted(scene), adjusted(scene, None)
    assert free.free_network is not None
    assert free.free_network.directions == ()
    np.testing.assert_array_equal(free.state.object_point, ordinary.state.object_point)
    np.testing.assert_array_equal(free.cofactor.of_points, ordinary.cofactor.of_points)
    assert ordinary.free_network is None


def test_values_alone_are_the_same() -> None:
    scene = scene_of("nothing")
    options = AdjustmentOptions(free_network="both")
    estimate = estimate_block(scene.block, scene.observations, options)
    full = adjusted(scene, "both")
    np.testing.assert_allclose(estimate.state.object_point, full.state.object_point, atol=1e-8)


def test_a_parameter_that_no_observation_knows_is_still_refused() -> None:
    scene = scene_of("nothing", free={BORESIGHT: True})
    with pytest.raises(DatumDefectError) as caught:
        adjusted(scene)
    assert caught.value.defect == 3
    assert caught.value.explanation[0] == "No observation depends on boresight_roll of forward."
    assert not caught.value.of_block


def test_a_missing_datum_says_that_a_free_network_would_do() -> None:
    with pytest.raises(DatumDefectError) as caught:
        adjusted(scene_of("nothing"), None)
    assert caught.value.of_block
    assert "free network" in str(caught.value)


def test_projection_centres_on_one_line_cannot_carry_a_rotation_about_it() -> None:
    scene = two_strips(strips=1, frame="cartesian", noise_seed=3, **NOTHING)
    along = np.linspace(-500.0, 500.0, len(scene.block.images))[:, None] * np.array([1.0, 0.2, 0.0])
    straight = replace(scene.block, projection_centre=along + np.array([0.0, 0.0, 1000.0]))
    with pytest.raises(InconsistentBlockError, match="projection centres cannot define the datum"):
        adjusted(replace(scene, block=straight), "projection_centres")


def test_gross_errors_are_found_in_a_free_network() -> None:
    scene = scene_of("nothing", points_along=16, points_across=10)
    rays = scene.observations.image_points
    count = np.bincount(rays.point)
    wrong = np.flatnonzero(count[rays.point] >= 5)[[10, 50]]
    xy = rays.xy.copy()
    xy[wrong] += 60e-6
    spoilt = replace(scene, observations=replace(scene.observations, image_points=replace(rays, xy=xy)))
    result = adjusted(spoilt, critical_value=4.13)
    rejected = np.flatnonzero((result.groups[0].status == 1).any(axis=1))
    assert set(wrong) <= set(rejected)
    assert sum(group.redundancy_sum for group in result.groups) == pytest.approx(
        result.test.redundancy, abs=1e-6
    )


def test_a_cartesian_frame_of_plane_heights_leaves_the_scale_however_many_they_are() -> None:
    scene = scene_of("nothing", frame="cartesian")
    points = scene.block.object_point
    assert isinstance(scene.block.frame, CartesianFrame)
    chosen = np.arange(0, len(points), 5)
    heights = 40.0 + 0.02 * points[chosen, 0] - 0.01 * points[chosen, 1]
    start = points.copy()
    start[chosen, 2] = heights
    weights = StochasticModel.from_sigma(np.tile([np.nan, np.nan, 0.05], (len(chosen), 1)))
    control = ControlPoints(chosen, np.full((len(chosen), 3), np.nan), heights, scene.block.frame, weights)
    block = replace(scene.block, object_point=start)
    system = System.of(
        block, Observations(scene.observations.image_points, (control,)), inner_constraints="object_points"
    )
    state = block.approximate_state()
    movements = open_movements(system, state, reduced_normals(system, state))
    assert movements is not None
    assert movements.defect == 4


def test_the_normal_matrix_of_the_system_parameters_is_that_of_the_datum(both: BothWays) -> None:
    reduced = both.cofactor().reduced
    scale = np.sqrt(np.diagonal(reduced.corner))
    product = scale[:, None] * reduced.normal @ reduced.corner / scale
    np.testing.assert_allclose(product, np.eye(len(scale)), atol=1e-7)


@pytest.mark.parametrize("distances", [0, 5])
def test_parameters_that_the_datum_does_not_touch_are_judged_as_in_any_block(distances: int) -> None:
    scene = scene_of("nothing, additional parameters", distances=distances)
    result = adjusted(scene)
    system = System.of(scene.block, scene.observations, inner_constraints="object_points")
    found, expected = normals_at(system, result.state), normals_of_result(result)
    assert found.redundancy == expected.redundancy == result.test.redundancy + result.layout.border
    root = np.sqrt(np.diagonal(expected.normal))
    assert np.all(np.abs(found.normal - expected.normal) <= 1e-6 * np.outer(root, root))


def test_other_image_points_of_a_free_network_are_adjusted_in_its_datum() -> None:
    scene = scene_of("nothing")
    result = adjusted(scene)
    again = Readjustment.of(scene.block, result, AdjustmentOptions(free_network="object_points"))
    found = again.adjust(again.image_points, result.state)
    assert found.sigma0 == pytest.approx(result.test.sigma0, rel=1e-9)
    np.testing.assert_allclose(found.state.object_point, result.state.object_point, atol=1e-7)
