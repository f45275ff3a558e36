"""Smear from the movement of the camera: the formula against exact projection, and against edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.image_quality.edge_fit import fit_edge
from adjust.image_quality.edge_model import edge_values
from adjust.image_quality.edge_samples import EdgeLine, samples_of
from adjust.image_quality.image_motion import CameraMotion, MotionComparison, compared_with_motion
from adjust.image_quality.smear import smear
from tests.adjust.image_quality.synthetic_edges import unit_edge

FOCAL, TIME, BLUR, NOISE = 15_000.0, 0.002, 0.45, 1.0
RATES = np.deg2rad([[2.0, 1.0, 5.0], [-1.5, 2.0, 0.0], [0.0, -2.5, -8.0]])


def motion_of(rate: Floats, velocity_by_height: Floats | None = None) -> CameraMotion:
    u = np.zeros(3) if velocity_by_height is None else velocity_by_height
    return CameraMotion(rate, np.full(3, 1e-4), u, TIME, 1e-6, FOCAL)


def projected(place: Floats, rate: Floats, u: Floats, time: float) -> Floats:
    """Image points (n, 2) of points of level ground at the distance 1, at a time from the middle."""
    ground = np.column_stack([place / FOCAL, -np.ones(len(place))])
    seen = (ground - time * u) @ rotation.exp(time * rate)
    return np.asarray(-FOCAL * seen[:, :2] / seen[:, 2:])


@pytest.mark.parametrize("rate", RATES)
def test_the_displacement_is_that_of_exact_projection(rate: Floats) -> None:
    place = np.random.default_rng(1).uniform(-8000.0, 8000.0, (50, 2))
    u = np.array([0.05, 0.01, -0.003])
    exact = projected(place, rate, u, 0.5 * TIME) - projected(place, rate, u, -0.5 * TIME)
    np.testing.assert_allclose(motion_of(rate, u).displacement(place), exact, atol=2e-4)


def exposed(rate: Floats, seed: int, edges: int = 60) -> tuple[Floats, Floats, Floats]:
    """Angles, blurs and places of edges over the format, each averaged over the exposure."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-7000.0, 7000.0, (edges, 2))
    slants = np.deg2rad(rng.choice([-1.0, 1.0], edges) * rng.uniform(3.0, 42.0, edges))
    angles = np.angle(np.exp(1j * (slants + rng.integers(4, size=edges) * 0.5 * np.pi)))
    # Five places of Gauss average a movement over two pixels better than forty equidistant ones.
    nodes, weights = np.polynomial.legendre.leggauss(5)
    times = 0.5 * TIME * nodes
    way = np.stack([projected(places, rate, np.zeros(3), time) - places for time in times])
    row, column = np.mgrid[:48, :48] - 24.0
    fits = []
    for index, angle in enumerate(angles):
        distance = column * np.cos(angle) + row * np.sin(angle)
        shifts = way[:, index, 0] * np.cos(angle) - way[:, index, 1] * np.sin(angle)
        image = 80.0 + 120.0 * unit_edge(
            distance,
            BLUR,
            lambda near, shifts=shifts, angle=angle: np.average(
                [edge_values(near - s, BLUR**2, angle).value for s in shifts], axis=0, weights=weights
            ),
            spread=2.5 * float(np.abs(shifts).max()),
        )
        image = image + rng.normal(0.0, NOISE, distance.shape)
        fits.append(fit_edge(samples_of(image, EdgeLine(24.0, 24.0, float(angle), 32.0))))
    return np.array([fit.angle for fit in fits]), np.array([fit.blur for fit in fits]), places


def compared(rate: Floats, stated: Floats, seed: int) -> MotionComparison:
    found = compared_with_motion(*exposed(rate, seed), motion_of(stated))
    assert found is not None
    return found


@pytest.mark.parametrize("rate", RATES)
def test_edges_show_the_smear_that_the_rates_make(rate: Floats) -> None:
    for seed in range(3):
        found = compared(rate, rate, seed)
        assert found.probability > 1e-3
        sigma = np.hypot(found.found.sigma_length, found.expected.sigma_length)
        assert found.found.length == pytest.approx(found.expected.length, abs=3.3 * sigma + 0.01)
        turned = found.found.direction - found.expected.direction
        assert abs(np.angle(np.exp(2j * turned)) / 2.0) < 3.3 * found.found.sigma_direction + 0.02


def test_the_covariance_of_a_movement_is_that_of_its_rates_and_time() -> None:
    """Derivatives by differences; and both covariances together weigh what is left between both."""
    random = np.random.default_rng(9)
    angle, place = random.uniform(-np.pi, np.pi, 60), random.uniform(-7000.0, 7000.0, (60, 2))
    blur = np.sqrt(BLUR**2 + random.normal(0.0, 0.02, 60))
    stated = replace(motion_of(RATES[0]), sigma_rate=np.array([3e-3, 2e-3, 1e-2]), sigma_exposure=2e-4)

    def found_with(motion: CameraMotion) -> MotionComparison:
        found = compared_with_motion(angle, blur, place, motion)
        assert found is not None
        return found

    def amplitude(moved: Floats) -> Floats:
        return found_with(replace(stated, rate=moved[:3], exposure=float(moved[3]))).expected.amplitude

    found, values = found_with(stated), np.append(stated.rate, stated.exposure)
    sigma = np.append(stated.sigma_rate, stated.sigma_exposure)
    columns = [0.5 * (amplitude(values + m) - amplitude(values - m)) for m in np.diag(0.1 * sigma)]
    expected = 100.0 * sum(np.outer(column, column) for column in columns)
    # A smear that looks some per cent longer than a Gaussian varies as much more.
    np.testing.assert_allclose(found.expected.covariance, expected, atol=0.2 * np.trace(expected))
    difference = found.found.amplitude - found.expected.amplitude
    weighted = np.linalg.solve(found.found.covariance + found.expected.covariance, difference)
    assert found.probability == pytest.approx(stats.f.sf(difference @ weighted / 2.0, 2, 57))
    # Without any movement only the edges are tested.
    still = found_with(replace(stated, rate=np.zeros(3)))
    alone = smear(angle, blur)
    assert alone is not None
    assert still.probability == pytest.approx(alone.probability)


def test_rates_of_another_image_contradict_the_edges() -> None:
    for rate, stated in ((RATES[0], RATES[1]), (RATES[1], np.zeros(3)), (np.zeros(3), RATES[2])):
        assert compared(rate, stated, 5).probability < 1e-4


@pytest.mark.parametrize("images", [4, pytest.param(12, marks=pytest.mark.slow)])
def test_still_camera_and_still_edges_agree(images: int) -> None:
    probabilities = [compared(np.zeros(3), np.zeros(3), seed).probability for seed in range(images)]
    assert min(probabilities) > 1e-3
    # Uniform between 0 and 1; the bounds for twelve are 0.2 and 0.8.
    assert np.mean(probabilities) == pytest.approx(0.5, abs=0.3 * np.sqrt(12 / images))
