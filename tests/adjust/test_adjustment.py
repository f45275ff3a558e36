"""The adjustment as a whole: closed answers, recovery of the truth, invariances."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.errors import AdjustmentError, DivergenceError, InconsistentBlockError
from adjust.geometry import rotation
from adjust.geometry.earth import CartesianFrame
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    State,
)
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.system import Observations
from tests.adjust.scenes import ALL_FREE, MICROMETRE, Scene, two_strips


def adjusted(scene: Scene, **options: Any) -> AdjustmentResult:
    return adjust_block(scene.block, scene.observations, AdjustmentOptions(**options))


def with_group(scene: Scene, *groups: Any) -> Scene:
    others = (*scene.observations.others, *groups)
    return replace(scene, observations=replace(scene.observations, others=others))


def prior(given: float, sigma: float) -> DirectObservations:
    """One observation of the first component of the lever arm of camera 0."""
    return DirectObservations(
        FAMILIES[LEVER_ARM],
        np.array([0]),
        np.array([[given, 0.0, 0.0]]),
        StochasticModel.from_sigma(np.array([[sigma, np.nan, np.nan]])),
    )


def test_two_measurements_of_a_parameter_give_their_weighted_mean() -> None:
    scene = two_strips(gnss=False, free={LEVER_ARM: [[True, False, False]]})
    result = adjusted(with_group(scene, prior(1.0, 0.1), prior(1.6, 0.2)))
    # Weights 100 and 25.
    assert result.state.system[LEVER_ARM][0, 0] == pytest.approx((100 * 1.0 + 25 * 1.6) / 125)
    assert result.cofactor.reduced.corner[0, 0] == pytest.approx(1 / 125)
    first, second = result.groups[-2:]
    assert first.redundancy[0, 0] == pytest.approx(1 - 100 / 125)
    assert second.redundancy[0, 0] == pytest.approx(1 - 25 / 125)
    assert first.residual[0, 0] == pytest.approx(0.12)
    assert second.residual[0, 0] == pytest.approx(-0.48)
    # Both test the same single condition: w = ± 0.6 / √(0.1² + 0.2²).
    assert first.standardized[0, 0] == pytest.approx(0.6 / np.sqrt(0.05))
    assert second.standardized[0, 0] == pytest.approx(-0.6 / np.sqrt(0.05))


def test_height_of_a_point_in_the_normal_case_has_the_textbook_sigma() -> None:
    # Two vertical photographs with known orientation: σ_Z = h² / (b c) · √2 σ_x for a point at y = 0,
    # σ_X = σ_Z/h·x̄ … and σ_Y = h/c · σ_y/√2.
    h, b, c, sigma = 1000.0, 400.0, 0.1, 2.0 * MICROMETRE
    centre = np.array([[-0.5 * b, 0.0, h], [0.5 * b, 0.0, h]])
    control = np.array([[-250.0, -300.0, 10.0], [250.0, -310.0, -20.0], [240.0, 300.0, 0.0]])
    points = np.vstack([[0.0, 0.0, 0.0], control, [[-245.0, 305.0, 15.0]]])
    point, image = np.divmod(np.arange(2 * len(points)), 2)
    difference = points[point] - centre[image]
    xy = -c * difference[:, :2] / difference[:, 2:]
    weights = np.full(xy.shape, 1e-12)
    weights[:2] = sigma
    rays = ImagePoints(image, point, np.zeros(2, int), xy, weights, np.ones(len(xy), bool))
    # Orientations so well known by control that the first point alone is uncertain.
    survey = ControlPoints(
        np.arange(1, 5),
        points[1:],
        points[1:, 2],
        CartesianFrame(),
        StochasticModel.from_sigma(np.full((4, 3), 1e-7)),
    )
    scene = two_strips(strips=1, images_per_strip=2, control=())
    system = tuple(
        replace(p, values=np.array([[c, 0.0, 0.0]])) if p.family.name == INTERIOR_ORIENTATION else p
        for p in scene.block.system
    )
    block = replace(
        scene.block,
        frame=CartesianFrame(),
        points=tuple("abcde"),
        projection_centre=centre,
        local_from_camera=np.stack([np.eye(3)] * 2),
        object_point=points,
        system=system,
    )
    result = adjust_block(block, Observations(rays, (survey,)))
    found = np.sqrt(np.diagonal(result.cofactor.of_points[0]))
    expected = [h / c * sigma / np.sqrt(2), h / c * sigma / np.sqrt(2), h * h / (b * c) * np.sqrt(2) * sigma]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize(
    "switches",
    [
        {},
        {"frame": "cartesian"},
        {"control": ("full",) * 4, "gnss": False, "ins": False},
        {"control": (), "ins": False},
        {"free": {BORESIGHT: True, LEVER_ARM: True}},
        {"cameras": 2, "flights": 2, "free": {BORESIGHT: True, GNSS_SHIFT: [[False], [True]]}},
    ],
    ids=["all", "cartesian", "control only", "GNSS only", "system", "two cameras and flights"],
)
def test_exact_observations_lead_back_to_the_truth_from_two_metres_and_half_a_degree(
    switches: dict[str, Any],
) -> None:
    scene = two_strips(start_seed=5, **switches)
    result = adjusted(scene)
    offset = result.state.projection_centre - scene.truth.projection_centre
    assert np.abs(offset).max() < 1e-6
    small = np.swapaxes(scene.truth.local_from_camera, 1, 2) @ result.state.local_from_camera
    assert np.abs(rotation.log(small)).max() < 1e-9
    assert np.abs(result.state.object_point - scene.truth.object_point).max() < 1e-6
    for name, values in scene.truth.system.items():
        assert np.abs(result.state.system[name] - values).max() < (
            1e-9 if FAMILIES[name].unit == "rad" else 1e-6
        )
    assert result.test.weighted_squares < 1e-6


def test_self_calibration_of_two_cameras_leads_back_to_the_truth() -> None:
    scene = two_strips(
        cameras=2, flights=2, free=ALL_FREE, start_seed=5, headings_deg=(90.0, 270.0, 0.0), strips=3
    )
    result = adjusted(scene)
    found = result.state.system[INTERIOR_ORIENTATION]
    np.testing.assert_allclose(found, scene.truth.system[INTERIOR_ORIENTATION], atol=1e-9)
    np.testing.assert_allclose(result.state.system[BORESIGHT], scene.truth.system[BORESIGHT], atol=1e-8)
    assert np.abs(result.state.system[LEVER_ARM] - scene.truth.system[LEVER_ARM]).max() < 1e-5


def permuted(scene: Scene, images: Ints, points: Ints) -> Scene:
    """The same block with images and object points in another order; ``images[k]`` is the new k-th."""
    new_image, new_point = np.argsort(images), np.argsort(points)
    rays = scene.observations.image_points
    order = np.lexsort((new_image[rays.image], new_point[rays.point]))
    block = scene.block
    moved_block = replace(
        block,
        images=tuple(np.array(block.images)[images]),
        camera_of_image=block.camera_of_image[images],
        flight_of_image=block.flight_of_image[images],
        points=tuple(np.array(block.points)[points]),
        projection_centre=block.projection_centre[images],
        local_from_camera=block.local_from_camera[images],
        object_point=block.object_point[points],
    )
    moved_rays = replace(
        rays,
        image=new_image[rays.image][order],
        point=new_point[rays.point][order],
        camera_of_image=rays.camera_of_image[images],
        xy=rays.xy[order],
        sigma=rays.sigma[order],
        active=rays.active[order],
    )
    others: list[Any] = []
    for group in scene.observations.others:
        if isinstance(group, ControlPoints):
            others.append(replace(group, point=new_point[group.point]))
        elif hasattr(group, "body_from_camera"):
            others.append(replace(group, event=new_image[group.event]))
        else:
            others.append(group)
    return replace(scene, block=moved_block, observations=Observations(moved_rays, tuple(others)))


def test_the_order_of_images_and_points_does_not_matter() -> None:
    scene = two_strips(
        cameras=2, free={BORESIGHT: True, INTERIOR_ORIENTATION: True}, noise_seed=1, start_seed=2
    )
    generator = np.random.default_rng(3)
    images = generator.permutation(len(scene.block.images))
    points = generator.permutation(len(scene.block.points))
    given, other = adjusted(scene), adjusted(permuted(scene, images, points))
    assert other.test.weighted_squares == pytest.approx(given.test.weighted_squares, rel=1e-9)
    np.testing.assert_allclose(
        other.state.projection_centre, given.state.projection_centre[images], atol=1e-8
    )
    np.testing.assert_allclose(other.state.object_point, given.state.object_point[points], atol=1e-8)
    np.testing.assert_allclose(
        other.cofactor.of_points, given.cofactor.of_points[points], rtol=1e-6, atol=1e-14
    )
    np.testing.assert_allclose(other.cofactor.reduced.corner, given.cofactor.reduced.corner, rtol=1e-6)


def moved(scene: Scene, turn: Floats, shift: Floats) -> Scene:
    """The same Cartesian block with another local frame: x′ = turn · x + shift."""
    block = replace(
        scene.block,
        projection_centre=scene.block.projection_centre @ turn.T + shift,
        local_from_camera=turn @ scene.block.local_from_camera,
        object_point=scene.block.object_point @ turn.T + shift,
        system=tuple(
            replace(parameters, values=parameters.values @ turn.T)
            if parameters.family.name in (GNSS_SHIFT, GNSS_STRIP_BIAS, GNSS_DRIFT)
            else parameters
            for parameters in scene.block.system
        ),
    )
    others: list[Any] = []
    for group in scene.observations.others:
        if group.name == "gnss_positions":
            changed: Any = group
            others.append(
                replace(
                    changed,
                    observed=changed.observed @ turn.T + shift,
                    local_from_enu=turn @ changed.local_from_enu,
                    motion=replace(changed.motion, velocity=changed.motion.velocity @ turn.T),
                )
            )
        elif group.name == "ins_attitudes":
            changed = group
            others.append(replace(changed, observed=turn @ changed.observed))
        else:
            others.append(group)
    return replace(
        scene, block=block, observations=Observations(scene.observations.image_points, tuple(others))
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rotating_and_shifting_the_local_frame_changes_no_residual(seed: int) -> None:
    # Without control points, whose "up" is the frame's own axis.
    scene = two_strips(frame="cartesian", control=(), free={BORESIGHT: True}, noise_seed=1, start_seed=2)
    generator = np.random.default_rng(seed)
    turn = rotation.exp(generator.normal(size=3))
    given, other = adjusted(scene), adjusted(moved(scene, turn, generator.uniform(-500.0, 500.0, 3)))
    assert other.test.weighted_squares == pytest.approx(given.test.weighted_squares, rel=1e-9)
    assert other.test.redundancy == given.test.redundancy
    np.testing.assert_allclose(other.groups[0].residual, given.groups[0].residual, atol=1e-12)
    for ours, theirs in zip(other.groups, given.groups, strict=True):
        np.testing.assert_allclose(ours.redundancy, theirs.redundancy, atol=1e-7)
    np.testing.assert_allclose(
        other.cofactor.of_points, turn @ given.cofactor.of_points @ turn.T, rtol=1e-6, atol=1e-12
    )


def all_variances(result: AdjustmentResult) -> Floats:
    return np.concatenate(
        [
            np.diagonal(result.cofactor.reduced.of_exposures, axis1=1, axis2=2).ravel(),
            np.diagonal(result.cofactor.of_points, axis1=1, axis2=2).ravel(),
            np.diagonal(result.cofactor.reduced.corner),
        ]
    )


def test_one_more_observation_never_increases_a_variance() -> None:
    scene = two_strips(free={LEVER_ARM: True, BORESIGHT: True})
    before = all_variances(adjusted(scene))
    after = all_variances(adjusted(with_group(scene, prior(0.4, 0.02))))
    assert np.all(after <= before * (1.0 + 1e-9))
    assert after.min() > 0.0
    assert (after < 0.999 * before).any()


@pytest.mark.parametrize("image", [0, 4, 9])
def test_one_observation_less_never_decreases_a_variance(image: int) -> None:
    scene = two_strips(free={BORESIGHT: True})
    gnss = scene.observations.others[1]
    less = list(scene.observations.others)
    less[1] = gnss.without(gnss.event == image)
    fewer = replace(scene, observations=replace(scene.observations, others=tuple(less)))
    before, after = all_variances(adjusted(scene)), all_variances(adjusted(fewer))
    assert np.all(after >= before * (1.0 - 1e-9))
    assert (after > 1.001 * before).any()


@pytest.mark.parametrize("scale", [0.1, 3.0])
def test_scaling_all_sigmas_scales_the_cofactors_and_keeps_the_values(scale: float) -> None:
    scene = two_strips(noise_seed=4, free={BORESIGHT: True})

    def rescaled(group: Any) -> Any:
        if group.name == "image_points":
            return replace(group, sigma=scale * group.sigma)
        model = group.stochastic
        return replace(
            group, stochastic=replace(model, whitener=model.whitener / scale, sigma=model.sigma * scale)
        )

    groups = [rescaled(group) for group in scene.observations.groups]
    other = replace(scene, observations=Observations(groups[0], tuple(groups[1:])))
    one, two = adjusted(scene), adjusted(other)
    np.testing.assert_allclose(two.state.projection_centre, one.state.projection_centre, atol=1e-7)
    np.testing.assert_allclose(all_variances(two), scale**2 * all_variances(one), rtol=1e-7)
    assert two.test.sigma0 == pytest.approx(one.test.sigma0 / scale, rel=1e-6)


def test_uncontrolled_observations_take_part_and_rejected_ones_do_not() -> None:
    positions = next(item for item in adjusted(two_strips()).groups if item.group.name == "gnss_positions")
    status = np.full(positions.status.shape, ObservationStatus.USED)
    status[1] = ObservationStatus.UNCONTROLLED
    status[2, 0] = ObservationStatus.REJECTED
    status[3] = ObservationStatus.NOT_USED
    left = replace(positions, status=status).taking_part.stochastic.present
    np.testing.assert_array_equal(np.flatnonzero(left.any(axis=1)), [0, 1, 2, *range(4, len(status))])
    status[2] = ObservationStatus.REJECTED
    left = replace(positions, status=status).taking_part.stochastic.present
    np.testing.assert_array_equal(np.flatnonzero(left.any(axis=1)), [0, 1, *range(4, len(status))])


def test_iterations_are_reported_as_they_happen() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    seen: list[int] = []
    result = adjust_block(scene.block, scene.observations, progress=lambda step: seen.append(step.number))
    assert seen == [step.number for step in result.iterations[-1]]
    squares = [step.weighted_squares for step in result.iterations[-1]]
    assert squares == sorted(squares, reverse=True)
    assert result.iterations[-1][-1].largest_move < 1e-3


def test_a_start_that_is_far_off_is_refused_with_what_moves_most() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    with pytest.raises(DivergenceError) as caught:
        adjusted(scene, most_iterations=2)
    assert caught.value.iterations == 2
    assert len(caught.value.weighted_squares) == 2
    assert "image image_" in caught.value.largest
    assert "Check the approximate values, units and angle conventions" in str(caught.value)


def test_cameras_turned_upside_down_are_said_to_have_the_scene_behind_them() -> None:
    scene = two_strips()
    upside_down = scene.block.local_from_camera @ rotation.about_x(np.pi)
    block = replace(scene.block, local_from_camera=upside_down)
    with pytest.raises(InconsistentBlockError, match="behind a camera"):
        adjust_block(block, scene.observations)


def test_a_block_with_a_wrong_shape_or_value_is_refused() -> None:
    block: Block = two_strips().block
    with pytest.raises(InconsistentBlockError, match="projection_centre has the shape"):
        replace(block, projection_centre=block.projection_centre[1:])
    broken = block.object_point.copy()
    broken[3, 2] = np.nan
    with pytest.raises(InconsistentBlockError, match="object points are not all finite"):
        replace(block, object_point=broken)


def test_the_given_block_is_left_as_it_was() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, free=ALL_FREE, flights=2)
    before: State = scene.block.approximate_state()
    copies = {name: values.copy() for name, values in before.system.items()}
    centre = before.projection_centre.copy()
    adjusted(scene)
    np.testing.assert_array_equal(scene.block.projection_centre, centre)
    for parameters in scene.block.system:
        np.testing.assert_array_equal(parameters.values, copies[parameters.family.name])


def test_joint_cofactors_are_requested_by_names_or_indices() -> None:
    scene = two_strips(noise_seed=1)
    names = scene.block.points
    by_name, by_index = (
        adjust_block(scene.block, scene.observations, AdjustmentOptions(joint_points=wanted)).joint_cofactor
        for wanted in ((names[7], names[2]), (2, 7))
    )
    assert by_name is not None
    assert by_index is not None
    assert by_name.points.tolist() == by_index.points.tolist() == [2, 7]
    np.testing.assert_array_equal(by_name.matrix, by_index.matrix)


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (("point_00x",), "There is no object point 'point_00x'. Did you mean"),
        ((2, 1_000_000), "An index of joint_points is outside 0"),
        ((2.0,), "must be integers"),
    ],
)
def test_joint_cofactors_of_points_that_do_not_exist_are_refused(wanted: Any, said: str) -> None:
    scene = two_strips()
    with pytest.raises(AdjustmentError, match=re.escape(said)):
        adjust_block(scene.block, scene.observations, AdjustmentOptions(joint_points=wanted))
