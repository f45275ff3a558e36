"""Similarities between two systems of coordinates."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from adjust.approximate.similarity import (
    Similarity,
    between_directions,
    fitted,
    mean_rotation,
    on_a_line,
    robustly_fitted,
    turned_about,
)
from adjust.geometry import rotation

GENERATOR_SEED = 5


def movement() -> Similarity:
    return Similarity(2.5, rotation.exp(np.array([0.3, -1.2, 2.0])), np.array([100.0, -20.0, 7.0]))


@pytest.mark.parametrize("flat", [1.0, 0.0], ids=["in space", "in a plane"])
def test_the_movement_of_points_is_found_exactly(flat: float) -> None:
    source = np.random.default_rng(GENERATOR_SEED).normal(size=(10, 3)) * [1.0, 1.0, flat]
    found = fitted(source, movement().points(source))
    assert found.scale == pytest.approx(2.5)
    assert found.rotation == pytest.approx(movement().rotation, abs=1e-12)
    assert found.shift == pytest.approx(movement().shift)


def test_of_noisy_and_of_mirrored_points_the_nearest_movement_is_a_rotation_with_the_best_scale() -> None:
    generator = np.random.default_rng(GENERATOR_SEED)
    source = generator.normal(size=(12, 3)) * [1.0, 1.0, 0.3]
    noisy = movement().points(source) + 0.5 * generator.normal(size=source.shape)
    for target in (noisy, source * [1.0, 1.0, -1.0]):
        found = fitted(source, target)
        assert np.linalg.det(found.rotation) == pytest.approx(1.0)
        one, other = source - source.mean(axis=0), target - target.mean(axis=0)
        turned = one @ found.rotation.T
        assert found.scale == pytest.approx(np.sum(turned * other) / np.sum(one**2))
        # No rotation nearby leaves less.
        left = np.sum((found.points(source) - target) ** 2)
        for small in np.concatenate([np.eye(3), -np.eye(3)]) * 1e-3:
            beside = Similarity.about(
                found.scale, rotation.exp(small) @ found.rotation, source.mean(axis=0), target.mean(axis=0)
            )
            assert np.sum((beside.points(source) - target) ** 2) > left


def test_a_third_of_the_points_may_be_wrong() -> None:
    generator = np.random.default_rng(GENERATOR_SEED)
    source = generator.normal(size=(30, 3))
    target = movement().points(source)
    target[::3] += generator.normal(size=(10, 3)) * 50.0
    found, agreeing = robustly_fitted(source, target)
    assert found.rotation == pytest.approx(movement().rotation, abs=1e-9)
    assert not agreeing[::3].any()
    assert agreeing.sum() == 20
    # Of noisy ones what is off by a hundred times the noise.
    target = movement().points(source) + 0.01 * generator.normal(size=source.shape)
    target[::3] += [1.0, 0.0, 0.0]
    _, agreeing = robustly_fitted(source, target)
    np.testing.assert_array_equal(agreeing, np.arange(30) % 3 > 0)


@pytest.mark.parametrize(("count", "judged"), [(5, False), (6, True)])
def test_of_six_points_a_wrong_one_is_told(count: int, *, judged: bool) -> None:
    source = np.random.default_rng(GENERATOR_SEED).normal(size=(count, 3))
    target = movement().points(source)
    target[2] += 50.0
    found, agreeing = robustly_fitted(source, target)
    assert agreeing.tolist() == [not judged or k != 2 for k in range(count)]
    assert (found.scale == pytest.approx(2.5)) is judged


def test_points_on_a_line_are_recognised() -> None:
    along = np.linspace(0.0, 1.0, 9)[:, None] * np.array([3.0, 1.0, 0.2])
    assert on_a_line(along)
    assert on_a_line(along[:2])
    assert not on_a_line(np.vstack([along, [0.0, 1.0, 0.0]]))
    for across, on_one in ((0.019, True), (0.021, False)):
        cross = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, across, 0.0], [0.0, -across, 0.0]])
        assert on_a_line(cross) is on_one


def test_directions_are_turned_into_each_other() -> None:
    one, other = np.array([1.0, 2.0, -1.0]), np.array([0.0, -1.0, 4.0])
    turned = between_directions(one, other) @ one
    assert turned / np.linalg.norm(turned) == pytest.approx(other / np.linalg.norm(other))
    assert between_directions(one, -one) @ one == pytest.approx(-one)
    up = np.array([0.0, 0.0, 1.0])
    assert turned_about(up, np.array([1.0, 0.0, 5.0]), np.array([0.0, 2.0, 1.0])) == pytest.approx(
        rotation.about_z(np.pi / 2)
    )


def test_the_mean_of_rotations_leaves_out_a_wrong_one() -> None:
    generator = np.random.default_rng(GENERATOR_SEED)
    true = movement().rotation
    near = true @ rotation.exp(1e-3 * generator.normal(size=(20, 3)))
    near[3] = np.eye(3)
    assert mean_rotation(near) == pytest.approx(true, abs=1e-3)


def test_the_mean_of_many_rotations_takes_no_more_memory_than_some_hundred_times_as_many() -> None:
    """A third of 20,000 is turned anyhow; all pairs of them would take 29 GB."""
    generator, true = np.random.default_rng(GENERATOR_SEED), movement().rotation
    turns = generator.normal(size=(20_000, 3)) * np.where(np.arange(20_000) % 3, 1e-3, 1.0)[:, None]
    tracemalloc.start()
    found = mean_rotation(rotation.exp(turns) @ true)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == pytest.approx(true, abs=1e-4)
    assert peak < 100e6
