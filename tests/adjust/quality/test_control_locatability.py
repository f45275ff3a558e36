"""Which control points may be rejected: those that no other one explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats
from adjust.least_squares import Adjusted, Adjuster
from adjust.observations.control_point import ControlPoints
from adjust.options import AdjustmentOptions
from adjust.parameters import GNSS_SHIFT, ConsideredParameters, ParameterPlace
from adjust.quality.control_locatability import doubtful_control
from adjust.quality.locatability import ADVANTAGE
from adjust.quality.rejection import Rejection, SnoopingRule, located, reject
from adjust.quality.snooping_statistic import normal_equivalent
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.system import System
from tests.adjust.scenes import ControlKind, Scene, two_strips

CRITICAL = 4.13


def with_errors(scene: Scene, errors: dict[int, float]) -> Scene:
    """The same block with errors of the heights of some control points, metres."""
    others = list(scene.observations.others)
    number = next(k for k, group in enumerate(others) if isinstance(group, ControlPoints))
    control = others[number]
    assert isinstance(control, ControlPoints)
    height = control.given_height.copy()
    height[list(errors)] += list(errors.values())
    others[number] = replace(control, given_height=height)
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


def snooped(scene: Scene, **options: object) -> AdjustmentResult:
    return adjust_block(
        scene.block,
        scene.observations,
        AdjustmentOptions(critical_value=CRITICAL, **options),  # type: ignore[arg-type]
    )


def rejected_control(result: AdjustmentResult) -> set[int]:
    status = next(item.status for item in result.groups if isinstance(item.group, ControlPoints))
    return set(np.flatnonzero((status == ObservationStatus.REJECTED).any(axis=1)).tolist())


@pytest.mark.parametrize("robust", [None, "huber"])
@pytest.mark.parametrize("wrong", [0, 3])
def test_of_four_heights_without_positions_none_is_rejected_and_the_wrong_one_is_among_those_named(
    wrong: int, robust: str | None
) -> None:
    scene = two_strips(control=("full",) * 4, gnss=False, ins=False, noise_seed=3)
    result = snooped(with_errors(scene, {wrong: 4.0}), robust=robust)
    assert rejected_control(result) == set()
    control = next(item.group for item in result.groups if isinstance(item.group, ControlPoints))
    assert isinstance(control, ControlPoints)
    named = set(result.inseparable.tolist())
    assert int(control.point[wrong]) in named
    assert len(named) >= 3


@pytest.mark.parametrize("errors", [{1: 2.0}, {1: 2.0, 3: 2.0}])
def test_with_positions_the_wrong_ones_are_rejected(errors: dict[int, float]) -> None:
    """Two of equal errors explain as much as each other, but not the same."""
    scene = two_strips(control=("full",) * 5, noise_seed=3)
    result = snooped(with_errors(scene, errors))
    assert rejected_control(result) == set(errors)
    assert len(result.inseparable) == 0


def test_points_that_a_larger_error_swamps_are_not_named() -> None:
    """That of the fifth point alone explains them; one after the other, as all gross errors."""
    scene = two_strips(control=("full",) * 5, ins=False, noise_seed=2)
    adjusted = adjusted_once(with_errors(scene, {4: 4.0, 0: 0.3}))
    every = doubtful_control(adjusted, CRITICAL)
    assert every is not None
    assert np.flatnonzero(every.rows).tolist() == [1, 2, 3]
    found = reject(adjusted, SnoopingRule(CRITICAL))
    assert np.flatnonzero(found.rejected[1]).tolist() == [4]
    assert found.inseparable.tolist() == []


def adjusted_once(scene: Scene) -> Adjusted:
    return Adjuster(AdjustmentOptions()).adjust(System.of(scene.block, scene.observations), scene.truth)


def of_full_matrices(
    adjusted: Adjusted, least: float, chosen: Bools | None = None, spread: Floats | None = None
) -> tuple[list[int], list[int], float]:
    """Rows, object points and size of the doubtful control points of the first group but image points.

    spread (N, k) is what errors of considered parameters do to the whitened observations.
    """
    group = adjusted.observations.others[0]
    design = design_matrix(adjusted.system, adjusted.state)
    matrix = design.matrix.toarray()
    remainder = np.eye(len(matrix)) - matrix @ full_cofactor(design) @ matrix.T
    residual, first = remainder @ design.misclosure, design.row_start[1]
    spread = np.zeros((len(matrix), 1)) if spread is None else spread
    inverse = np.eye(len(matrix)) - spread @ np.linalg.solve(
        np.eye(spread.shape[1]) + spread.T @ spread, spread.T
    )
    normal = matrix.T @ inverse @ matrix
    weight = inverse - inverse @ matrix @ np.linalg.solve(normal, matrix.T @ inverse)
    of_residuals = remainder + (remainder @ spread) @ (remainder @ spread).T
    model, n = group.stochastic, len(group.event)
    rows = first + np.arange(3 * n).reshape(n, 3)

    def explained(points: list[int]) -> float:
        """T of errors of all coordinates of some points."""
        errors = np.zeros((len(matrix), 3 * len(points)))
        for k, point in enumerate(points):
            errors[rows[point], 3 * k : 3 * k + 3] = model.whitener[point] * model.present[point]
        score = errors.T @ weight @ design.misclosure
        return float(score @ np.linalg.pinv(errors.T @ weight @ errors, rcond=1e-7, hermitian=True) @ score)

    size, statistic = np.zeros(n), np.zeros(n)
    for point in range(n):
        own = rows[point][model.present[point]]
        values, vectors = np.linalg.eigh(of_residuals[np.ix_(own, own)])
        told = values > 1e-3
        statistic[point] = np.sum((vectors.T @ residual[own])[told] ** 2 / values[told])
        size[point] = normal_equivalent(statistic[[point]], np.array([told.sum()]))[0]
    candidates = np.flatnonzero(size > max(CRITICAL, least) if chosen is None else chosen)
    suspects = np.flatnonzero(statistic >= statistic[candidates].min(initial=np.inf) - ADVANTAGE)
    suspects = suspects[np.argsort(-statistic[suspects])][:10]
    candidates = np.intersect1d(candidates, suspects)
    alone = [explained([point]) for point in range(n)]
    pairs = [
        (row, other)
        for row in candidates.tolist()
        for other in suspects.tolist()
        if other != row
        and alone[row] - alone[other] <= ADVANTAGE
        and explained([row, other]) - alone[other] <= CRITICAL**2
    ]
    doubtful = sorted({row for row, _ in pairs})
    points = np.unique(group.point[[place for pair in pairs for place in pair]]).tolist() if pairs else []
    return doubtful, points, float(max(size[doubtful], default=0.0))


def test_of_what_was_chosen_the_points_that_cannot_be_told_apart_stay() -> None:
    scene = two_strips(control=("full",) * 5, gnss=False, ins=False, noise_seed=3)
    adjusted = adjusted_once(with_errors(scene, {4: 2.0, 0: 0.3}))
    control = adjusted.observations.others[0].point
    chosen = Rejection.nothing(adjusted.observations, len(scene.block.points))
    chosen.rejected[1][:], chosen.given_up[control] = True, True
    rows, points, _ = of_full_matrices(adjusted, 0.0, chosen.rejected[1])
    assert 0 < len(rows) < 5
    found = located(adjusted, chosen, SnoopingRule(CRITICAL))
    assert np.flatnonzero(~found.rejected[1]).tolist() == rows
    assert np.flatnonzero(~found.given_up[control]).tolist() == rows
    assert found.inseparable.tolist() == points


@pytest.mark.parametrize("gnss", [False, True])
@pytest.mark.parametrize(
    "kinds",
    [
        ("full",) * 5,
        ("full", "plan", "height", "height", "height"),
        ("covariance", "height", "full", "full", "height"),
        ("full",) * 12,
    ],
)
def test_what_cannot_be_told_apart_is_what_full_matrices_say(
    kinds: tuple[ControlKind, ...], *, gnss: bool
) -> None:
    scene = two_strips(control=kinds, gnss=gnss, ins=False, noise_seed=3)
    adjusted = adjusted_once(with_errors(scene, {len(kinds) - 1: 2.0, 0: 0.3}))
    named, every = 0, np.eye(len(kinds), dtype=bool)
    for least, chosen in (
        (0.0, None),
        (15.0, None),
        *((0.0, one) for one in every),
        (0.0, every[0] | every[4]),
        (0.0, every.any(axis=0)),
    ):
        found = doubtful_control(adjusted, CRITICAL, least, None if chosen is None else (chosen, chosen))
        assert found is not None
        rows, points, size = of_full_matrices(adjusted, least, chosen)
        assert (np.flatnonzero(found.rows).tolist(), found.points.tolist()) == (rows, points)
        assert found.size == pytest.approx(size, rel=1e-4)
        named += len(rows)
    assert named > 0


def test_errors_of_considered_parameters_are_no_errors_of_control_points() -> None:
    """The vertical shift of the positions is known to half a metre, the control points are 0.3 m too high."""
    kinds, sigma = ("full",) * 5, 0.5
    scene, freed = (
        two_strips(control=kinds, ins=False, noise_seed=3, free={GNSS_SHIFT: free}) for free in (False, True)
    )
    places = tuple(ParameterPlace(GNSS_SHIFT, 0, component) for component in range(3))
    known = ConsideredParameters(places, sigma**2 * np.eye(3))
    scene = replace(scene, block=replace(scene.block, considered=known))
    scene = with_errors(scene, {0: 1.3, 1: 0.3, 2: 0.3, 3: 0.3, 4: 0.3})
    adjusted = adjusted_once(scene)
    design = design_matrix(System.of(freed.block, scene.observations), adjusted.state)
    spread = sigma * design.matrix.toarray()[:, design.border_columns]
    every = np.ones(len(kinds), dtype=bool)
    for chosen in (None, every):
        found = doubtful_control(adjusted, CRITICAL, 0.0, None if chosen is None else (chosen, chosen))
        assert found is not None
        rows, points, size = of_full_matrices(adjusted, 0.0, chosen, spread)
        assert (np.flatnonzero(found.rows).tolist(), found.points.tolist()) == (rows, points)
        assert found.size == pytest.approx(size, rel=1e-4)
    assert rows
    assert of_full_matrices(adjusted, 0.0)[0] != of_full_matrices(adjusted, 0.0, None, spread)[0]
