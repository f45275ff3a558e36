"""Stereo models and their y-parallaxes: definition, closed forms, derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources
from adjust.georeferencing.y_parallax import (
    CommonPoints,
    StereoModels,
    YParallaxes,
    common_points,
    consecutive_images,
    y_parallaxes,
)
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.simulate.flight_plan import base_of
from adjust.simulate.noise import NoiseSpecification
from tests.adjust.georeferencing.flights import Flight, fly, simulated, vertical_strip
from tests.adjust.georeferencing.test_space_intersection import STEPS
from tests.adjust.simulate.specifications import small_specification, without_noise

#: UltraCam Eagle with 80 mm at 780 m (mathematics: 10.9 µm for GNSS/INS of 5 cm and 0.003, 0.003, 0.008°).
EAGLE = FrameCamera("UCE", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
INS = np.deg2rad([0.003, 0.003, 0.008])


@pytest.fixture(scope="module")
def exact() -> Flight:
    return fly(simulated(noise=without_noise(small_specification()).noise), with_additional=False)


@pytest.fixture(scope="module")
def noisy() -> Flight:
    return fly(simulated())


def models_of(flight: Flight) -> StereoModels:
    truth = flight.simulated.truth
    return consecutive_images(truth.plan.strip, truth.trajectory.time)


def parallaxes_of(flight: Flight, sources: ErrorSources | None = None) -> YParallaxes:
    common = common_points(flight.rays, models_of(flight))
    return y_parallaxes(flight.rays, sources or flight.sources(), common)


def in_base_frame(flight: Flight, common: CommonPoints) -> Floats:
    """y' left minus y' right (q,) of rays turned into the base frame and brought to −c, written out."""
    state, rays = flight.orientations.state, flight.rays
    result = []
    for left, right in zip(common.left, common.right, strict=True):
        i, j = rays.image[left], rays.image[right]
        base = state.projection_centre[j] - state.projection_centre[i]
        x = base / np.linalg.norm(base)
        up = 0.5 * (state.local_from_camera[i][:, 2] + state.local_from_camera[j][:, 2])
        y = np.cross(up, x)
        y /= np.linalg.norm(y)
        frame = np.array([x, y, np.cross(x, y)])
        ordinates = []
        for ray, image in ((left, i), (right, j)):
            c, x0, y0 = state.system[INTERIOR_ORIENTATION][0]
            measured = rays.xy[ray]
            d = frame @ state.local_from_camera[image] @ [measured[0] - x0, measured[1] - y0, -c]
            ordinates.append(-c * d[1] / d[2])
        result.append(ordinates[0] - ordinates[1])
    return np.array(result)


def test_rays_that_meet_have_no_parallax(exact: Flight) -> None:
    found = parallaxes_of(exact)
    assert len(found.parallax) > 100
    assert np.abs(found.parallax).max() < 1e-12


def test_it_is_the_difference_of_ordinates_in_the_base_frame(noisy: Flight) -> None:
    found = parallaxes_of(noisy)
    expected = in_base_frame(noisy, found.common)
    assert np.abs(expected).max() > 5e-6
    np.testing.assert_allclose(found.parallax, expected, atol=1e-14)


@pytest.mark.parametrize("distorted", [False, True])
@pytest.mark.parametrize("family", STEPS)
def test_sensitivities_to_the_calibration_are_those_of_differences(family: str, distorted: bool) -> None:
    noise = without_noise(small_specification()).noise
    flight = fly(simulated(noise=noise), with_additional=True, distorted=distorted)
    count = flight.system[family].shape[1]
    unit = CalibrationErrors({family: np.arange(count)[None, :]}, np.eye(count))
    common = common_points(flight.rays, models_of(flight))
    matrix = y_parallaxes(flight.rays, flight.sources(unit), common).sensitivity.parameters.toarray()
    for component in range(count):
        change = np.zeros(count)
        change[component] = STEPS[family]
        ahead, behind = (
            y_parallaxes(flight.rays, flight.with_system(family, sign * change).sources(), common).parallax
            for sign in (1.0, -1.0)
        )
        numeric = (ahead - behind) / (2.0 * STEPS[family])
        # Focal length and common shifts leave next to nothing; what there is must be there.
        assert np.abs(numeric - matrix[:, component]).max() < 1e-4 * max(np.abs(matrix).max(), 1e-6)


def test_sensitivities_to_an_orientation_are_those_of_differences(exact: Flight) -> None:
    common = common_points(exact.rays, models_of(exact))
    sources = exact.sources()
    matrix = y_parallaxes(exact.rays, sources, common).sensitivity.images.toarray()
    scale = np.linalg.inv(sources.orientations.of_noise)
    image, step = int(models_of(exact).right[0]), np.array([1e-3, 2e-3, -1e-3, 2e-6, -1e-6, 3e-6])
    state = sources.orientations.state
    centre, turned = state.projection_centre.copy(), state.local_from_camera.copy()
    centre[image] += step[:3]
    turned[image] = turned[image] @ rotation.exp(step[3:])
    moved = replace(state, projection_centre=centre, local_from_camera=turned)
    after = y_parallaxes(
        exact.rays, replace(sources, orientations=replace(sources.orientations, state=moved)), common
    )
    predicted = matrix[:, 6 * image : 6 * image + 6] @ (scale[image] @ step)
    assert np.abs(predicted).max() > 1e-7
    assert np.abs(after.parallax - predicted).max() < 1e-3 * np.abs(predicted).max()


def test_the_part_of_the_image_coordinates_is_that_of_differences() -> None:
    """With a distortion, and coordinates of unlike σ."""
    flight = fly(simulated(), with_additional=True, distorted=True)
    sigma = np.random.default_rng(4).uniform(1e-6, 4e-6, flight.rays.sigma.shape)
    rays = replace(flight.rays, sigma=sigma)
    every = common_points(rays, models_of(flight))
    rows = np.arange(0, len(every.model), len(every.model) // 8)
    common = CommonPoints(every.model[rows], every.left[rows], every.right[rows])
    found, expected = y_parallaxes(rays, flight.sources(), common), np.zeros(len(rows))
    for side in (common.left, common.right):
        for component in range(2):
            ends = []
            for step in (1e-6, -1e-6):
                xy = rays.xy.copy()
                xy[side, component] += step
                ends.append(y_parallaxes(replace(rays, xy=xy), flight.sources(), common).parallax)
            expected += ((ends[0] - ends[1]) / 2e-6 * sigma[side, component]) ** 2
    np.testing.assert_allclose(found.by_image_points, expected, rtol=1e-3)
    both = found.by_image_points + found.sensitivity.variance()
    np.testing.assert_allclose(found.variance(), both, rtol=1e-12)


def test_elements_of_the_relative_orientation_move_the_right_image(exact: Flight) -> None:
    """Its centre across the base, in parts of that, and its rotation; against differences."""
    every = common_points(exact.rays, models_of(exact))
    rows = np.flatnonzero(every.model == every.model[0])
    common = CommonPoints(every.model[rows], every.left[rows], every.right[rows])
    sources, state = exact.sources(), exact.orientations.state
    left, right = exact.rays.image[common.left[0]], exact.rays.image[common.right[0]]
    base = state.projection_centre[right] - state.projection_centre[left]
    x = base / np.linalg.norm(base)
    y = np.cross(state.local_from_camera[left][:, 2] + state.local_from_camera[right][:, 2], x)
    y /= np.linalg.norm(y)
    across = np.linalg.norm(base) * np.array([y, np.cross(x, y)])
    found = y_parallaxes(exact.rays, sources, common).of_relative_orientation
    for element in range(5):
        ends = []
        for step in (1e-5, -1e-5):
            centre, turned = state.projection_centre.copy(), state.local_from_camera.copy()
            if element < 2:
                centre[right] += step * across[element]
            else:
                turned[right] = turned[right] @ rotation.exp(step * np.eye(3)[element - 2])
            moved = replace(state, projection_centre=centre, local_from_camera=turned)
            orientations = replace(sources.orientations, state=moved)
            ends.append(
                y_parallaxes(exact.rays, replace(sources, orientations=orientations), common).parallax
            )
        numeric = (ends[0] - ends[1]) / 2e-5
        np.testing.assert_allclose(found[:, element], numeric, atol=1e-4 * np.abs(numeric).max())


def test_vertical_images_follow_the_normal_case() -> None:
    # σ² = 2 (σ_Y c/h)² + 2 (y σ_Z/h)² + 2 c² (1 + y²/c²)² σ_ω² + (x₁² + x₂²) (y²/c² σ_φ² + σ_κ²)
    flight = eagle_strip()
    found = parallaxes_of(flight)
    rays, height = flight.rays, 780.0
    c, sigma_position = EAGLE.focal_length, 0.05
    left, right = rays.xy[found.common.left], rays.xy[found.common.right]
    y, x1, x2 = left[:, 1], left[:, 0], right[:, 0]
    expected = (
        2.0 * (sigma_position * c / height) ** 2
        + 2.0 * (y * sigma_position / height) ** 2
        + 2.0 * c**2 * (1.0 + y**2 / c**2) ** 2 * INS[0] ** 2
        + ((x1 * y) ** 2 + (x2 * y) ** 2) / c**2 * INS[1] ** 2
        + (x1**2 + x2**2) * INS[2] ** 2
    )
    np.testing.assert_allclose(found.sensitivity.variance(), expected, rtol=1e-3)
    # x1 and x2 differ by the base in the image; the image coordinates enter by σ √2.
    np.testing.assert_allclose(x1 - x2, base_of(EAGLE, height, 0.6) * c / height, rtol=1e-3)
    np.testing.assert_allclose(found.by_image_points, 2.0 * (1.2e-6) ** 2, rtol=1e-3)


def test_gnss_and_ins_of_the_published_flight_predict_eleven_micrometres() -> None:
    found = parallaxes_of(eagle_strip())
    rms_um = 1e6 * np.sqrt(np.mean(found.sensitivity.variance()))
    assert rms_um == pytest.approx(10.9, abs=0.4)


def eagle_strip() -> Flight:
    noise = NoiseSpecification(1.2e-6, (0.02, 0.02, 0.02), (0.05, 0.05, 0.05), tuple(INS), level=0.0)
    return fly(vertical_strip(EAGLE, 780.0, base_of(EAGLE, 780.0, 0.6), noise))


def test_images_that_follow_each_other_in_a_strip_form_models() -> None:
    strip = np.array([0, 1, 0, 1, 0, -1, 2, -1])
    time = np.array([3.0, 1.0, 1.0, 2.0, 2.0, 0.0, 5.0, 1.0])
    models = consecutive_images(strip, time)
    assert list(zip(models.left.tolist(), models.right.tolist(), strict=True)) == [(2, 4), (4, 0), (1, 3)]


def test_a_flight_without_strips_has_no_models() -> None:
    assert consecutive_images(np.full(4, -1), np.arange(4.0)).count == 0


@given(st.permutations(range(12)))
def test_the_order_of_the_images_does_not_matter(order: list[int]) -> None:
    strip, time = np.arange(12) // 4, np.arange(12.0)
    permuted = np.array(order)
    models = consecutive_images(strip[permuted], time[permuted])
    pairs = {(int(permuted[i]), int(permuted[j])) for i, j in zip(models.left, models.right, strict=True)}
    assert pairs == {(i, i + 1) for i in range(11) if i % 4 != 3}


def test_common_points_are_those_measured_in_both_images(noisy: Flight) -> None:
    truth, rays = noisy.simulated.truth, noisy.rays
    models = consecutive_images(truth.plan.strip, truth.trajectory.time)
    common = common_points(rays, models)
    np.testing.assert_array_equal(rays.point[common.left], rays.point[common.right])
    np.testing.assert_array_equal(rays.image[common.left], models.left[common.model])
    np.testing.assert_array_equal(rays.image[common.right], models.right[common.model])
    assert np.all(np.diff(common.model) >= 0)
    for model in range(models.count):
        seen = [set(rays.point[rays.image == i].tolist()) for i in (models.left[model], models.right[model])]
        assert set(rays.point[common.left[common.model == model]].tolist()) == seen[0] & seen[1]


def test_image_points_in_any_order_within_a_point_are_found() -> None:
    rays = ImagePoints(
        np.array([1, 0, 2, 0]),
        np.array([0, 0, 1, 1]),
        np.zeros(3, dtype=np.int64),
        np.zeros((4, 2)),
        np.ones((4, 2)),
        np.ones(4, dtype=bool),
    )
    common = common_points(rays, consecutive_images(np.array([0, 0, 0]), np.array([0.0, 1.0, 2.0])))
    assert (common.left.tolist(), common.right.tolist(), common.model.tolist()) == ([1], [0], [0])
