"""A smear is found with its length and direction from edges that were blurred by it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.image_quality.edge_fit import fit_edge
from adjust.image_quality.edge_model import edge_values
from adjust.image_quality.edge_samples import EdgeLine, samples_of
from adjust.image_quality.smear import Smear, fit_smear, smear
from tests.adjust.image_quality.synthetic_edges import unit_edge
from tests.grids import diagonal_daily

BLUR, NOISE = 0.5, 1.0


def smeared_edge(angle: float, length: float, direction: float, rng: np.random.Generator) -> Floats:
    """An edge, averaged over places along the way the image took during the exposure."""
    row, column = np.mgrid[:48, :48] - 24.0
    distance = column * np.cos(angle) + row * np.sin(angle)
    places = 25 if length else 1
    way = (np.arange(places) + 0.5) / places - 0.5
    shifts = length * way * np.cos(angle - direction)
    image = unit_edge(
        distance,
        BLUR,
        lambda near: np.mean([edge_values(near + s, BLUR**2, angle).value for s in shifts], axis=0),
        spread=length,
    )
    return 80.0 + 120.0 * image + rng.normal(0.0, NOISE, distance.shape)


def found_with(length: float, direction: float, seed: int) -> Smear:
    rng = np.random.default_rng(seed)
    slants = np.deg2rad(rng.choice([-1.0, 1.0], 40) * rng.uniform(3.0, 42.0, 40))
    angles = np.angle(np.exp(1j * (slants + rng.integers(4, size=40) * 0.5 * np.pi)))
    fits = [
        fit_edge(
            samples_of(smeared_edge(angle, length, direction, rng), EdgeLine(24.0, 24.0, float(angle), 32.0))
        )
        for angle in angles
    ]
    found = smear(np.array([fit.angle for fit in fits]), np.array([fit.blur for fit in fits]))
    assert found is not None
    return found


@pytest.mark.parametrize(("direction", "length"), diagonal_daily([0.0, 35.0, 90.0, -60.0], [0.7, 1.0, 1.5]))
def test_length_and_direction_are_those_of_the_movement(length: float, direction: float) -> None:
    found = found_with(length, float(np.deg2rad(direction)), seed=3)
    assert found.significant
    assert found.length == pytest.approx(length, abs=0.01 + 3.3 * found.sigma_length)
    turned = np.rad2deg(found.direction) - direction
    assert abs((turned + 90.0) % 180.0 - 90.0) < max(3.0, 3.3 * np.rad2deg(found.sigma_direction))


def moments(seed: int, length: float = 1.0, direction: float = 0.6) -> tuple[Floats, Floats]:
    """Angles of twenty edges and their second moments with noise, as if the smear were a Gaussian."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi, 20)
    smeared = length**2 / 12.0 * np.cos(angle - direction) ** 2
    return angle, BLUR**2 + smeared + rng.normal(0.0, 0.02, 20)


@pytest.mark.parametrize("length", [0.0, 0.5])
def test_the_probability_is_that_of_the_f_test_against_one_blur_for_all(length: float) -> None:
    angle, second = moments(1, length)
    design = np.column_stack([np.ones(20), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    squares = float(np.linalg.lstsq(design, second, rcond=None)[1][0])
    alone = 20.0 * float(np.var(second))
    found = smear(angle, np.sqrt(second))
    assert found is not None
    assert found.probability == pytest.approx(stats.f.sf((alone - squares) / 2.0 / (squares / 17.0), 2, 17))


def test_the_stated_sigmas_are_those_of_the_second_moments() -> None:
    """Closed case: derivatives by differences, and the σ of a second moment from the residuals."""
    angle, second = moments(2)
    fit = fit_smear(angle, second)
    assert fit is not None
    design = np.column_stack([np.ones(20), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    sigma = np.sqrt(np.linalg.lstsq(design, second, rcond=None)[1][0] / 17.0)

    def at(move: Floats) -> Floats:
        moved = fit_smear(angle, second + move)
        assert moved is not None
        return np.array([moved.length, moved.direction])

    step = 1e-4
    by_moments = np.array([at(move) - at(-move) for move in step * np.eye(20)]) / (2.0 * step)
    of_length, of_direction = sigma * np.linalg.norm(by_moments, axis=0)
    # What a smear looks longer by than a Gaussian, some per cent, is left out there.
    assert fit.sigma_length == pytest.approx(of_length, rel=0.1)
    assert fit.sigma_direction == pytest.approx(of_direction, rel=1e-3)


# What the probability is made of is tested above; here, that errors of edges are alike in all directions.
@pytest.mark.parametrize("images", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_an_image_without_smear_shows_none(images: int) -> None:
    assert not any(found_with(0.0, 0.0, seed).significant for seed in range(images))


def test_edges_of_two_directions_alone_determine_no_smear() -> None:
    angle = np.tile([0.1, 0.1 + 0.5 * np.pi], 10)
    assert smear(angle, np.full(20, 0.5)) is None
    assert smear(np.array([0.1, 0.5]), np.array([0.5, 0.6])) is None
