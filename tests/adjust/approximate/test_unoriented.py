"""Approximate orientations from image points: closed answers, plane objects, lines, wrong points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.approximate import image_model
from adjust.approximate.image_model import ImageModel
from adjust.approximate.image_pair import pair_models, pairs_by_common_points
from adjust.approximate.measured_images import MeasuredImages
from adjust.approximate.placement import KnownPlaces
from adjust.approximate.resection import resect
from adjust.approximate.unoriented import FoundOrientations, find_orientations
from adjust.arrays import Bools, Floats
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from tests.close_range import CloseRange, close_range
from tests.grids import diagonal_daily

LENS = FrameCamera("lens", 6000, 4000, 4e-6, 0.024, (5e-5, -3e-5), "corner", 0)


def measured_images(
    truth: CloseRange, seen: Bools | None = None, sigma_px: float = 0.0, wrong: float = 0.0
) -> MeasuredImages:
    """Image points of a truth; a part of them is anywhere in the image."""
    generator = np.random.default_rng(3)
    p = np.einsum("nij,nmi->nmj", truth.local_from_camera, truth.target - truth.projection_centre[:, None])
    xy = -LENS.focal_length * p[..., :2] / p[..., 2:] + np.array(LENS.principal_point)
    xy += sigma_px * LENS.pixel_size * generator.normal(size=xy.shape)
    anywhere = generator.random(xy.shape[:2]) < wrong
    xy[anywhere] = generator.uniform(-0.5, 0.5, (int(anywhere.sum()), 2)) * [0.024, 0.016]
    seen = np.ones(xy.shape[:2], dtype=bool) if seen is None else seen
    point, image = np.nonzero(seen.T)
    rays = ImagePoints(
        image.astype(np.int64),
        point.astype(np.int64),
        np.zeros(len(truth.projection_centre), dtype=np.int64),
        xy[image, point],
        np.full((len(image), 2), 0.1 * LENS.pixel_size),
        np.ones(len(image), dtype=bool),
    )
    return MeasuredImages(rays, (LENS,), len(truth.target))


def known(truth: CloseRange) -> KnownPlaces:
    """Nothing is known yet."""
    n, m = len(truth.projection_centre), len(truth.target)
    return KnownPlaces(np.full((m, 3), np.nan), np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan))


def assert_true(
    truth: CloseRange, found: FoundOrientations, metres: float, kept: Bools | None = None
) -> None:
    kept = np.ones(len(truth.projection_centre), dtype=bool) if kept is None else kept
    assert (found.model.oriented == kept).all()
    off = found.model.projection_centre[kept] - truth.projection_centre[kept]
    assert np.abs(off).max() < metres
    turn = np.swapaxes(found.model.local_from_camera[kept], 1, 2) @ truth.local_from_camera[kept]
    assert np.abs(rotation.log(turn)).max() < metres / 2.0


def scene(images: int, targets: int, relief: float) -> CloseRange:
    return close_range(images, targets, relief, np.random.default_rng(1))


@pytest.mark.parametrize("relief", [0.0, 0.5], ids=["plane", "with relief"])
def test_one_of_the_relative_orientations_of_two_images_is_the_true_one(relief: float) -> None:
    truth = scene(2, 40, relief)
    measured = measured_images(truth)
    assert pairs_by_common_points(measured, *np.ones((2, 2), dtype=bool)).tolist() == [[0, 1]]
    first = truth.local_from_camera[0]
    base = first.T @ (truth.projection_centre[1] - truth.projection_centre[0])
    models = list(pair_models(measured, 0, 1))
    off = [
        np.abs(item.rotation - first.T @ truth.local_from_camera[1]).max()
        + np.abs(item.projection_centre - base / np.linalg.norm(base)).max()
        for item in models
    ]
    assert min(off) < 1e-5
    if relief == 0.0:
        # A plane has two, which its homography gives besides the one that was found first.
        assert min(off[1:]) < 1e-5
        assert max(off) > 0.1


def test_pairs_with_most_common_points_come_first_and_those_of_one_place_last() -> None:
    truth = scene(4, 60, 0.5)
    centre, turn = truth.projection_centre.copy(), truth.local_from_camera.copy()
    centre[3], turn[3] = centre[0], turn[0] @ rotation.exp(np.array([0.0, 0.0, 0.2]))
    seen = np.zeros((4, 60), dtype=bool)
    seen[[0, 3], :], seen[1, :40], seen[2, 30:60] = True, True, True
    measured = measured_images(replace(truth, projection_centre=centre, local_from_camera=turn), seen)
    pairs = pairs_by_common_points(measured, *np.ones((2, 4), dtype=bool)).tolist()
    # 40, 40, 30, 30 and 10 points; 60 of the two at one place.
    assert pairs == [[0, 1], [1, 3], [0, 2], [2, 3], [1, 2], [0, 3]]


def test_image_points_in_pixels_are_those_of_the_camera_of_each_image() -> None:
    """Counted from its principal point, down; what is behind a camera is off by any amount."""
    truth = scene(2, 12, 0.5)
    other = FrameCamera("other", 3000, 2000, 8e-6, 0.035, (-2e-5, 1e-5), "corner", 0)
    given = measured_images(truth)
    measured = MeasuredImages(
        replace(given.rays, camera_of_image=np.array([1, 0])), (LENS, other), given.points
    )
    assert [measured.focal_px(0), measured.focal_px(1)] == pytest.approx([0.035 / 8e-6, 0.024 / 4e-6])
    of_first = given.rays.image == 0
    xy = given.rays.xy[of_first] - np.array(other.principal_point)
    np.testing.assert_allclose(measured.pixel[of_first], xy / 8e-6 * [1.0, -1.0], rtol=1e-12)
    behind = truth.projection_centre + 2.0 * (truth.projection_centre - truth.target.mean(axis=0))
    points = np.broadcast_to(behind[0], truth.target.shape)
    state = measured.state(truth.projection_centre, truth.local_from_camera, points)
    assert np.isinf(measured.residual_px(state)[of_first]).all()


def test_rejected_image_points_join_no_pair() -> None:
    measured = measured_images(scene(2, 20, 0.5))
    rejected = measured.rays.without(measured.rays.point >= 5)
    few = MeasuredImages(rejected, measured.cameras, measured.points)
    assert pairs_by_common_points(few, *np.ones((2, 2), dtype=bool)).shape == (0, 2)


def test_a_resection_leaves_out_what_is_wrong() -> None:
    truth = scene(1, 60, 0.3)
    measured = measured_images(truth, sigma_px=0.3, wrong=0.3)
    found = resect(measured, 0, measured.rows_of_image[0], truth.target)
    assert found is not None
    assert 0.6 < found.part < 0.8
    assert found.projection_centre == pytest.approx(truth.projection_centre[0], abs=1e-3)


@pytest.mark.parametrize(("relief", "wrong"), diagonal_daily([0.0, 0.5], [0.1, 0.0]))
def test_three_control_points_place_what_image_points_have_joined(relief: float, wrong: float) -> None:
    truth = scene(12, 60, relief)
    places = known(truth)
    places.object_point[[0, 7, 59]] = truth.target[[0, 7, 59]]
    measured = measured_images(truth, sigma_px=0.1, wrong=wrong)
    if wrong:
        # Control is measured with care.
        clean = measured_images(truth, sigma_px=0.1)
        careful = np.isin(measured.rays.point, [0, 7, 59])
        measured.rays.xy[careful] = clean.rays.xy[careful]
    assert_true(truth, find_orientations(measured, places), 5e-3)


def test_positions_on_a_line_and_images_that_look_down_place_a_strip() -> None:
    truth = strip()
    places = known(truth)
    places.projection_centre[:] = truth.projection_centre
    found = find_orientations(measured_images(truth), places)
    assert not found.placements[0].turned
    assert_true(truth, found, 1e-3)


def strip() -> CloseRange:
    """Eight vertical images along x, 3 m above a rough field."""
    generator = np.random.default_rng(2)
    target = generator.uniform([-2.0, -1.0, 0.0], [6.0, 1.0, 1.0], (400, 3))
    centre = np.column_stack([np.linspace(0.0, 4.0, 8), np.zeros(8), np.full(8, 4.0)])
    return CloseRange(centre, np.tile(np.eye(3), (8, 1, 1)), target)


def test_two_heads_of_one_body_spend_no_trial_on_the_pairs_of_one_place() -> None:
    """48 events: their two pictures have more points in common than those of different events."""
    generator = np.random.default_rng(4)
    target = generator.uniform([-2.0, -2.0, 0.0], [9.0, 7.0, 0.5], (500, 3))
    place = np.stack(
        [*(axis.ravel() for axis in np.meshgrid(np.arange(8.0), np.arange(6.0))), np.full(48, 4.0)], 1
    )
    second = rotation.exp(np.array([[0.01, -0.02, 0.4]]))[0]
    truth = CloseRange(
        np.repeat(place, 2, axis=0), np.tile(np.stack([np.eye(3), second]), (48, 1, 1)), target
    )
    p = np.einsum("nij,nmi->nmj", truth.local_from_camera, target - truth.projection_centre[:, None])
    seen = np.all(np.abs(p[..., :2] / p[..., 2:]) < [0.5, 0.4], axis=2)
    measured = measured_images(truth, seen, sigma_px=0.3, wrong=0.05)
    pairs = pairs_by_common_points(measured, *np.ones((2, 96), dtype=bool))
    assert len(pairs) == 40
    assert np.all(pairs[:, 0] // 2 != pairs[:, 1] // 2)
    places = known(truth)
    places.projection_centre[:] = truth.projection_centre
    assert_true(truth, find_orientations(measured, places), 2e-2)


def test_a_chain_whose_images_have_few_points_with_the_next_but_one_is_joined_by_pairs() -> None:
    """Too few for resections. Positions lie on a line, tilts are 3°, control is in the first images only."""
    level = strip()
    tilted = level.local_from_camera @ rotation.exp(np.array([[0.05, 0.0, 0.0]]))[0]
    truth = CloseRange(level.projection_centre, tilted, level.target)
    p = np.einsum("nij,nmi->nmj", truth.local_from_camera, truth.target - truth.projection_centre[:, None])
    seen = np.all(np.abs(p[..., :2] / p[..., 2:]) < [0.175, 0.3], axis=2)
    few = [int((seen[k] & seen[k + 1] & seen[k + 2]).sum()) for k in range(6)]
    assert max(few) <= 6
    assert min(few) > 0
    places = known(truth)
    places.projection_centre[:] = truth.projection_centre
    control = np.flatnonzero(seen[0] & seen[1])[::3]
    places.object_point[control] = truth.target[control]
    found = find_orientations(measured_images(truth, seen, sigma_px=0.1), places)
    assert all(item.turned for item in found.placements)
    assert_true(truth, found, 5e-3)


def test_attitudes_turn_what_two_control_points_place() -> None:
    truth = scene(6, 40, 0.5)
    places = known(truth)
    places.object_point[[0, 39]] = truth.target[[0, 39]]
    places.local_from_camera[2:] = truth.local_from_camera[2:]
    found = find_orientations(measured_images(truth), places)
    assert found.placements[0].turned
    assert_true(truth, found, 1e-4)


def test_given_orientations_carry_the_others() -> None:
    truth = scene(12, 60, 0.5)
    places = known(truth)
    places.projection_centre[:4], places.local_from_camera[:4] = (
        truth.projection_centre[:4],
        truth.local_from_camera[:4],
    )
    found = find_orientations(measured_images(truth), places)
    assert found.placements == ()
    assert_true(truth, found, 1e-4)


def test_without_anything_known_the_model_is_true_up_to_a_similarity() -> None:
    truth = scene(8, 40, 0.5)
    found = find_orientations(measured_images(truth), known(truth))
    assert found.model.oriented.all()
    assert not found.placements[0].scaled
    x, y = distances(found.model.projection_centre), distances(truth.projection_centre)
    assert x / x.mean() == pytest.approx(y / y.mean(), abs=1e-5)


def distances(x: Floats) -> Floats:
    return np.linalg.norm(x[:, None] - x[None, :], axis=2)


def test_an_image_with_too_few_common_points_is_left_out_and_parts_are_placed_by_their_own_control() -> None:
    truth = scene(13, 80, 0.5)
    seen = np.zeros((13, 80), dtype=bool)
    seen[:6, :40], seen[6:12, 40:] = True, True
    seen[12, :5] = True
    places = known(truth)
    control = [0, 7, 20, 39, 45, 60, 70, 79]
    places.object_point[control] = truth.target[control]
    found = find_orientations(measured_images(truth, seen), places)
    assert len(found.placements) == 2
    assert_true(truth, found, 1e-4, np.arange(13) < 12)


def test_the_same_input_gives_the_same_bits() -> None:
    truth = scene(8, 40, 0.5)
    one, other = (find_orientations(measured_images(truth, sigma_px=0.5), known(truth)) for _ in range(2))
    assert np.array_equal(one.model.projection_centre, other.model.projection_centre)


def model_in_place(truth: CloseRange, points: Floats) -> ImageModel:
    every = np.ones(len(truth.projection_centre), dtype=bool)
    return ImageModel(every, truth.projection_centre, truth.local_from_camera, points)


def test_points_whose_rays_meet_under_less_than_a_degree_are_in_no_model() -> None:
    truth = scene(2, 20, 0.5)
    near = truth.projection_centre.copy()
    far = np.linalg.norm(truth.target.mean(axis=0) - near[0])
    across = truth.local_from_camera[0][:, 0]
    for angle_deg, there in ((0.7, False), (1.6, True)):
        near[1] = near[0] + far * np.deg2rad(angle_deg) * across
        turn = np.stack([truth.local_from_camera[0]] * 2)
        moved = replace(truth, projection_centre=near, local_from_camera=turn)
        found = image_model._intersected(
            measured_images(moved), model_in_place(moved, np.full((20, 3), np.nan)), 3.0
        )
        known = np.isfinite(found.object_point).all(axis=1)
        assert known.mean() == pytest.approx(float(there), abs=0.25)


def test_the_misfit_of_a_model_counts_points_that_are_not_in_it_and_have_several_rays() -> None:
    truth = scene(3, 21, 0.5)
    seen = np.ones((3, 21), dtype=bool)
    seen[1:, :10] = False
    measured, points = measured_images(truth, seen, sigma_px=1.0), truth.target.copy()
    points[:10] = np.nan
    of_known = measured.residual_px(
        measured.state(truth.projection_centre, truth.local_from_camera, truth.target)
    )[measured.rays.point >= 10]
    misfit = image_model._misfit_px(measured, model_in_place(truth, points))
    assert misfit == pytest.approx(float(np.median(of_known)))
    points[10:17] = np.nan
    assert image_model._misfit_px(measured, model_in_place(truth, points)) == np.inf


def test_a_model_grows_to_as_many_images_as_are_wanted() -> None:
    truth = scene(8, 40, 0.5)
    measured, every = measured_images(truth), np.ones(8, dtype=bool)
    first = np.arange(8) < 3
    begun = image_model.model_of(measured, first, truth.projection_centre, truth.local_from_camera)
    for most in (3, 5, 8):
        assert image_model.grown(measured, begun, every, most=most).count == most
