from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.least_squares import Adjusted, Adjuster
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    GNSS_SHIFT,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from adjust.quality.alternative_products import ModelAlternative
from adjust.quality.detectability import INDISTINGUISHABLE, NON_CENTRALITY
from adjust.quality.model_alternatives import (
    AlternativeTests,
    ObservationAlternative,
    ParameterAlternative,
    alternative_tests,
)
from adjust.rig import OF_HEADS
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips, variants

FREE = {BORESIGHT: True, GNSS_SHIFT: True}
#: Lines in four directions, so that no error of the lever arm looks like a shift.
FOUR_WAYS = {"strips": 4, "headings_deg": (0.0, 90.0, 180.0, 270.0), "control": ("full",) * 5, "free": FREE}


def adjusted(scene: Scene) -> Adjusted:
    system = System.of(scene.block, scene.observations)
    return Adjuster(AdjustmentOptions()).adjust(system, scene.block.approximate_state())


def scored(found: Adjusted, alternatives: list[ModelAlternative]) -> AlternativeTests:
    return alternative_tests(found.system, found.solution, alternatives)


def with_given(scene: Scene, family: str, change: Floats) -> Scene:
    """The same block with other given values of a family."""
    system = tuple(
        replace(item, values=item.values + change) if item.family.name == family else item
        for item in scene.block.system
    )
    return replace(scene, block=replace(scene.block, system=system))


def with_free(scene: Scene, free: Mapping[str, object]) -> Scene:
    """The same block with more parameters free."""
    system = tuple(
        replace(item, free=item.free | np.broadcast_to(np.asarray(free[item.family.name]), item.free.shape))
        if item.family.name in free
        else item
        for item in scene.block.system
    )
    return replace(scene, block=replace(scene.block, system=system))


def value(found: Adjusted, family: str, entity: int, component: int) -> float:
    return float(found.state.system[family][entity, component])


def sigma(found: Adjusted, family: str, entity: int, component: int) -> float:
    column = int(found.system.layout.columns[family][entity, component])
    return float(np.sqrt(found.quality.reduced.corner[column, column]))


LEVER_ARMS: list[ModelAlternative] = [ParameterAlternative(LEVER_ARM, 0, axis) for axis in range(3)]


@pytest.mark.parametrize("name", variants())
def test_held_parameters_are_tested_as_the_dense_equations_with_them_would(name: str) -> None:
    scene = variants()[name]
    found = adjusted(scene)
    held = [
        (item.family.name, int(entity), int(component))
        for item in scene.block.system
        for entity, component in np.argwhere(~item.free)
        # Terms that a camera does not have are no parameters of it.
        if item.family.name != ADDITIONAL_PARAMETERS or item.values[entity, component] != 0.0
        # Nor is a reference head one against itself.
        if item.family.name not in OF_HEADS or item.values[entity].any()
    ]
    tests = scored(found, [ParameterAlternative(*one) for one in held])
    own = design_matrix(found.system, found.state)
    cofactor = full_cofactor(own)
    everything = {
        item.family.name: True
        if item.family.name not in (ADDITIONAL_PARAMETERS, *OF_HEADS)
        else item.values != 0.0
        for item in scene.block.system
    }
    wide = with_free(scene, everything).block
    design = design_matrix(replace(found.system, block=wide, layout=wide.layout), found.state)
    told = 0
    for k, (family, entity, component) in enumerate(held):
        border = wide.layout.columns[family][entity, component]
        column = design.matrix[:, [design.border_columns[border]]].toarray()[:, 0] if border >= 0 else 0.0
        moved = cofactor @ (own.matrix.T @ column) if np.any(column) else np.zeros(own.unknowns)
        left = column - own.matrix @ moved
        if not np.any(column) or left @ left < INDISTINGUISHABLE * (column @ column):
            assert np.isnan(tests.t[k])
            continue
        told += 1
        normal = float(column @ left)
        # M is a difference: what the unknowns leave of the column may be a millionth of its squares.
        tolerance = 1e-6 + 1e-11 * float(column @ column) / normal
        assert tests.sigma[k] == pytest.approx(normal**-0.5, rel=tolerance)
        assert tests.t[k] == pytest.approx(column @ own.misclosure * normal**-0.5, abs=10.0 * tolerance)
        scale = np.sqrt(np.diagonal(cofactor))[own.border_columns] * np.sqrt(normal)
        assert np.abs((tests.effect[:, k] - moved[own.border_columns]) / scale).max(initial=0.0) < 1e-6
    assert told >= 3


def test_a_small_error_is_estimated_as_by_an_adjustment_with_it_free() -> None:
    scene = with_given(two_strips(**FOUR_WAYS), LEVER_ARM, np.array([1e-4, -2e-4, 3e-4]))
    before = adjusted(scene)
    tests = scored(before, LEVER_ARMS)
    for axis in range(3):
        full = adjusted(with_free(scene, {LEVER_ARM: np.arange(3) == axis}))
        change = value(full, LEVER_ARM, 0, axis) - value(before, LEVER_ARM, 0, axis)
        spread = sigma(full, LEVER_ARM, 0, axis)
        assert tests.sigma[axis] == pytest.approx(spread, rel=1e-6)
        assert abs(tests.estimate[axis] - change) < 1e-6 * spread


def test_all_axes_together_are_an_adjustment_with_all_of_them_free() -> None:
    scene = with_given(two_strips(**FOUR_WAYS, noise_seed=3), LEVER_ARM, np.array([0.05, -0.08, 0.1]))
    before, full = adjusted(scene), adjusted(with_free(scene, {LEVER_ARM: True}))
    statistic, estimate = scored(before, LEVER_ARMS).joint([0, 1, 2])
    change = full.state.system[LEVER_ARM][0] - before.state.system[LEVER_ARM][0]
    spread = [sigma(full, LEVER_ARM, 0, axis) for axis in range(3)]
    assert np.abs((estimate - change) / spread).max() < 0.01
    assert statistic == pytest.approx(before.weighted_squares - full.weighted_squares, rel=1e-3)


@pytest.mark.parametrize(
    ("family", "component", "error"),
    [
        (LEVER_ARM, 0, -1.0),
        (LEVER_ARM, 1, 0.4),
        (TIME_OFFSET, 0, 0.010),
        (INTERIOR_ORIENTATION, 1, 50e-6),
        (INTERIOR_ORIENTATION, 0, 300e-6),
    ],
)
def test_a_large_error_is_named_with_its_size_and_what_it_has_done(
    family: str, component: int, error: float
) -> None:
    scene = two_strips(**FOUR_WAYS)
    change = np.zeros_like(next(i.values for i in scene.block.system if i.family.name == family))
    change[0, component] = error
    wrong = adjusted(with_given(scene, family, change))
    tests = scored(wrong, [ParameterAlternative(family, 0, component)])
    assert abs(tests.t[0]) > NON_CENTRALITY
    assert tests.estimate[0] == pytest.approx(-error, rel=0.05)
    border = np.zeros(wrong.system.layout.border)
    for name, columns in wrong.system.layout.columns.items():
        free = columns >= 0
        border[columns[free]] = (wrong.state.system[name] - scene.truth.system[name])[free]
    spread = np.sqrt(np.diagonal(wrong.quality.reduced.corner))
    moved = border / spread
    stated = tests.effect[:, 0] * tests.estimate[0] / spread
    assert np.abs(moved).max() > 0.05
    assert np.abs(moved - stated).max() < 0.05 * np.abs(moved).max()


def test_a_camera_that_was_remounted_between_two_flights_is_found_by_the_images_of_one() -> None:
    scene = two_strips(free=FREE, flights=2, noise_seed=5, strips=4)
    turned = np.array([0.0, 0.0, np.deg2rad(0.02)])
    second = np.repeat(np.arange(4), 5) >= 2
    others = list(scene.observations.others)
    number, ins = next((k, group) for k, group in enumerate(others) if group.name == "ins_attitudes")
    moved = np.where(second[ins.event, None, None], rotation.exp(-turned), np.eye(3))
    others[number] = replace(ins, observed=ins.observed @ np.swapaxes(moved, 1, 2))
    scene = replace(scene, observations=replace(scene.observations, others=tuple(others)))
    tests = scored(
        adjusted(scene),
        [ParameterAlternative(BORESIGHT, 0, component, second) for component in range(3)],
    )
    assert int(np.argmax(np.abs(tests.t))) == 2
    assert abs(tests.t[2]) > NON_CENTRALITY
    assert abs(tests.estimate[2]) == pytest.approx(turned[2], abs=3.0 * tests.sigma[2])


def test_heights_of_the_control_of_another_kind_are_found_beside_positions() -> None:
    scene = two_strips(free={BORESIGHT: True}, control=("full",) * 5, noise_seed=7)
    others = list(scene.observations.others)
    number, control = next((k, group) for k, group in enumerate(others) if group.name == "control_points")
    up = scene.block.frame.local_from_enu(scene.truth.object_point)[:, :, 2]
    raised = replace(
        control, given=control.given + 0.5 * up[control.point], given_height=control.given_height + 0.5
    )
    others[number] = raised
    scene = replace(scene, observations=replace(scene.observations, others=tuple(others)))
    tests = scored(
        adjusted(scene),
        [ObservationAlternative("control_points", [0.0, 0.0, 1.0] * np.ones((len(control.point), 3)))],
    )
    assert abs(tests.t[0]) > NON_CENTRALITY
    assert abs(tests.estimate[0]) == pytest.approx(0.5, abs=4.0 * tests.sigma[0])


def test_what_is_estimated_already_cannot_be_tested() -> None:
    found = adjusted(two_strips(free=FREE, noise_seed=1))
    same = ParameterAlternative(GNSS_SHIFT, 0, 0)
    tests = scored(found, [same, *LEVER_ARMS])
    assert list(tests.distinguishable) == [False, True, True, True]
    assert np.isnan([tests.t[0], tests.estimate[0], tests.sigma[0], tests.detectable[0]]).all()
    with pytest.raises(ValueError, match="from the unknowns"):
        tests.joint([0, 1])
    twice = scored(found, [*LEVER_ARMS[:1], LEVER_ARMS[0]])
    with pytest.raises(ValueError, match="from each other"):
        twice.joint([0, 1])


def test_two_errors_are_found_one_beside_the_other_and_nothing_else() -> None:
    """A wrong lever arm and a wrong time; sizes of both as with both of them free."""
    scene = with_given(two_strips(**FOUR_WAYS, noise_seed=2), LEVER_ARM, np.array([0.0, 1.0, 0.0]))
    scene = with_given(scene, TIME_OFFSET, np.array([[0.006]]))
    wrong = adjusted(scene)
    candidates = [
        *LEVER_ARMS,
        ParameterAlternative(TIME_OFFSET, 0, 0),
        ParameterAlternative(INTERIOR_ORIENTATION, 0, 0),
        ParameterAlternative(INTERIOR_ORIENTATION, 0, 1),
    ]
    tests = scored(wrong, candidates)
    found = tests.explanation(4.0)
    assert set(found) == {1, 3}
    assert abs(tests.t[found[0]]) == np.nanmax(np.abs(tests.t))
    statistic, sizes = tests.joint(found)
    assert dict(zip(found, sizes, strict=True)) == pytest.approx({1: -1.0, 3: -0.006}, rel=0.1)
    assert tests.together([1, 3]) == (pytest.approx(statistic), 2)


def test_of_alternatives_that_hang_together_only_what_can_be_told_is_counted() -> None:
    """Of a shift that is free, one of two halves of the images says all about the other."""
    first = np.arange(20) < 10
    found = adjusted(two_strips(**FOUR_WAYS, noise_seed=4))
    halves = [ParameterAlternative(GNSS_SHIFT, None, 0, images) for images in (first, ~first)]
    tests = scored(found, halves)
    statistic, freedom = tests.together([0, 1])
    assert freedom == 1
    assert statistic == pytest.approx(tests.t[0] ** 2, rel=1e-6)
    assert tests.t[0] == pytest.approx(-tests.t[1], rel=1e-6)
    assert tests.explanation(0.0)[:1] == (int(np.argmax(np.abs(tests.t))),)


@pytest.mark.slow
def test_without_any_error_t_is_standard_normal_and_an_error_is_found_as_often_as_stated() -> None:
    alternatives: list[ModelAlternative] = [*LEVER_ARMS[:2], ParameterAlternative(TIME_OFFSET, 0, 0)]
    first = scored(adjusted(two_strips(free=FREE, noise_seed=0)), alternatives)
    clean, found = [], 0
    trials = 150
    for seed in range(trials):
        scene = two_strips(free=FREE, noise_seed=1000 + seed)
        clean.append(scored(adjusted(scene), alternatives).t)
        wrong = with_given(scene, LEVER_ARM, np.array([0.0, first.detectable[1], 0.0]))
        found += bool(abs(scored(adjusted(wrong), alternatives).t[1]) > 3.2905)
    squares = np.mean(np.square(clean), axis=0)
    # 99.9 % bands of χ²_150 / 150 and of the share at a power of 0.80.
    assert np.all((squares > 0.66) & (squares < 1.42))
    assert 0.68 < found / trials < 0.90
