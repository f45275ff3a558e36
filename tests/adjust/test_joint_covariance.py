"""Joint covariances by name, against the inverse of the full normal equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.errors import UnknownNameError
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, ConsideredParameters, ParameterPlace
from adjust.quality.considered import with_considered
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import DesignMatrix, design_matrix, full_cofactor, redundancy_numbers
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips

FREE = {BORESIGHT: True, GNSS_SHIFT: [[False], [True]]}
POINTS, IMAGES = ("point_040", "point_003", "point_017"), ("image_07", "image_01")
CASES: dict[str, dict[str, Any]] = {
    "two cameras and flights": {},
    "distances join points": {"distances": 3},
    "correlated over time": {"gnss_correlation_s": 8.0, "ins_correlation_s": 20.0},
    "variance components": {"options": {"variance_components": True}},
    "rejection": {"options": {"critical_value": 2.5}},
}


def scene_of(**switches: Any) -> Scene:
    return two_strips(**{"cameras": 2, "flights": 2, "free": FREE, "noise_seed": 3, **switches})


def adjusted(scene: Scene, **options: Any) -> AdjustmentResult:
    return adjust_block(scene.block, scene.observations, AdjustmentOptions(**options))


def columns_of(design: DesignMatrix) -> Ints:
    """Images 7 and 1, boresight of both cameras, shift of the second flight, points 40, 3 and 17."""
    return np.concatenate(
        [
            design.exposure_columns[[7, 1]].ravel(),
            design.border_columns[np.arange(9)],
            design.point_columns[[40, 3, 17]].ravel(),
        ]
    )


def assert_same(found: Floats, expected: Floats) -> None:
    root = np.sqrt(np.diagonal(expected))
    assert np.max(np.abs(found - expected) / np.outer(root, root)) < 1e-9


@pytest.mark.parametrize("name", CASES)
def test_they_are_those_of_the_full_inverse(name: str) -> None:
    switches = dict(CASES[name])
    options = switches.pop("options", {})
    scene = scene_of(**switches)
    result = adjusted(scene, **options)
    design = design_matrix(System.of(scene.block, result.observations), result.state)
    columns = columns_of(design)
    expected = result.test.sigma0**2 * full_cofactor(design)[np.ix_(columns, columns)]
    found = result.covariance(POINTS, IMAGES, ("boresight", "gnss_shift"))
    assert_same(found.matrix, expected)
    np.testing.assert_array_equal(found.matrix, found.matrix.T)
    np.testing.assert_allclose(np.diagonal(found.correlation), 1.0, atol=1e-12)
    assert str(found.unknowns[12]) == "boresight_roll of forward"
    assert found.unknowns[3] == ("rotation_x", "image_07", "rad")
    assert (result.groups[0].rejected > 0) == (name == "rejection")


def test_their_blocks_are_those_of_the_marginal_cofactors() -> None:
    scene = scene_of()
    result = adjusted(scene)
    found = result.covariance(points=scene.block.points, sigma0=1.0).matrix
    for j, block in enumerate(result.cofactor.of_points):
        assert_same(found[3 * j : 3 * j + 3, 3 * j : 3 * j + 3], block)


def test_errors_of_considered_parameters_are_part_of_them() -> None:
    scene = two_strips(cameras=2, noise_seed=3, free={GNSS_SHIFT: True}, priors={GNSS_SHIFT: 0.1})
    places = tuple(ParameterPlace(BORESIGHT, 0, k) for k in range(3))
    block = replace(
        scene.block, considered=ConsideredParameters(places, np.diag(np.array([3.0, 2.0, 5.0]) * 1e-5) ** 2)
    )
    result = adjust_block(block, scene.observations)
    expected = with_considered(result.cofactor, result.sigma0)
    found = result.covariance(["point_017"], ["image_03"], ["gnss_shift"]).matrix
    assert_same(found[:6, :6], result.sigma0**2 * expected.reduced.of_exposures[3])
    assert_same(found[6:9, 6:9], result.sigma0**2 * expected.reduced.corner)
    assert_same(found[9:, 9:], result.sigma0**2 * expected.of_points[17])
    cross = result.sigma0**2 * expected.reduced.border[3]
    root = np.sqrt(np.diagonal(found))
    assert np.max(np.abs(found[:6, 6:9] - cross) / np.outer(root[:6], root[6:9])) < 1e-9


def test_in_a_free_network_they_are_those_of_its_datum() -> None:
    scene = two_strips(control=(), gnss=False, ins=False, noise_seed=3, start_seed=4)
    result = adjusted(scene, free_network="object_points")
    assert result.free_network is not None
    assert result.free_network.defect == 7
    found = result.covariance(points=scene.block.points, images=["image_02"], sigma0=1.0).matrix
    assert_same(found[:6, :6], result.cofactor.reduced.of_exposures[2])
    for j, block in enumerate(result.cofactor.of_points):
        own = slice(6 + 3 * j, 9 + 3 * j)
        assert_same(found[own, own], block)
    # The constrained points as a whole do not move: Σ x is free of errors in each axis, and so is Σ x · x⁰.
    of_points = found[6:, 6:].reshape(len(scene.block.points), 3, -1)
    largest = np.sqrt(np.diagonal(found)[6:]).max() ** 2
    assert np.abs(of_points.sum(axis=0)).max() < 1e-7 * largest * len(of_points)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"points": ["point_40"]}, "There is no object point 'point_40'. Did you mean 'point_040'"),
        ({"images": ["x"]}, "There is no image 'x'. There are: image_00, image_01"),
        ({"parameters": ["boresite"]}, "There is no system parameter 'boresite'. Did you mean 'boresight'"),
        (
            {"parameters": ["lever_arm"]},
            "'lever_arm' is held fixed in this adjustment, so it has no covariance. Est",
        ),
        (
            {"parameters": ["boresight", "boresight_roll"]},
            "A parameter is requested twice by boresight, bore",
        ),
        ({"images": ["image_01", "image_01"]}, "The image 'image_01' is named twice."),
    ],
)
def test_a_name_that_cannot_be_given_is_said_with_those_that_can(asked: dict[str, Any], says: str) -> None:
    with pytest.raises(UnknownNameError) as raised:
        adjusted(scene_of()).covariance(**asked)
    assert str(raised.value).startswith(says)


def test_a_text_in_place_of_a_list_of_names_is_refused() -> None:
    with pytest.raises(TypeError, match=r"points=\['point_003'\]"):
        adjusted(scene_of()).covariance(points="point_003")


def test_a_point_that_took_no_part_has_no_covariance() -> None:
    scene = scene_of()
    rays = scene.observations.image_points
    lonely = rays.point == 40
    lonely[np.flatnonzero(lonely)[0]] = False
    observations = replace(scene.observations, image_points=rays.without(lonely))
    result = adjust_block(scene.block, observations)
    with pytest.raises(UnknownNameError, match="'point_040' was not used"):
        result.covariance(points=["point_040"])


def test_only_what_is_asked_for_is_in_them() -> None:
    result = adjusted(scene_of())
    assert result.covariance().matrix.shape == (0, 0)
    roll = result.covariance(parameters=["boresight_roll of across"])
    assert [str(unknown) for unknown in roll.unknowns] == ["boresight_roll of across"]
    assert repr(roll).startswith("JointCovariance of 1 unknown: boresight_roll of across ± ")


def test_a_distance_between_points_that_turn_together_has_its_redundancy_number() -> None:
    """Nothing but the line of positions holds a strip: points are good to metres, distances to millimetres.

    Derivatives of another state than that of the normal equations would not cancel.
    """
    scene = two_strips(
        strips=1, images_per_strip=3, control=(), ins=False, distances=4, noise_seed=1, start_seed=4
    )
    result = adjusted(scene)
    total = sum(group.redundancy_sum for group in result.groups)
    assert total == pytest.approx(result.test.redundancy, abs=1e-5)
    design = design_matrix(result.system, result.solution.linearization)
    (expected,) = redundancy_numbers(result.system, design, full_cofactor(design))[-1].T
    np.testing.assert_allclose(result.groups[-1].redundancy[:, 0], expected, atol=1e-5)
