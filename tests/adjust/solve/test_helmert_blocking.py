"""Helmert blocking against dense linear algebra, whatever the block looks like."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.solve import dense_algebra, helmert_blocking
from adjust.solve.covisibility import Covisibility
from adjust.solve.dissection import dissect
from adjust.solve.fronts import HelmertBlocking
from adjust.solve.helmert_blocking import factorize_blocks


def flight(strips: int, length: int, reach: int) -> tuple[Covisibility, np.ndarray]:
    """A grid of exposures that see points with neighbours up to ``reach`` steps away."""
    place = np.stack(np.meshgrid(np.arange(strips), np.arange(length), indexing="ij"), -1).reshape(-1, 2)
    apart = np.abs(place[:, None] - place[None]).max(axis=2)
    return pattern_of(apart <= reach), np.column_stack([place * 100.0, np.full(len(place), 1000.0)])


def pattern_of(adjacent: np.ndarray) -> Covisibility:
    upper = np.triu(adjacent | np.eye(len(adjacent), dtype=bool))
    row, column = np.nonzero(upper)
    return Covisibility(np.searchsorted(row, np.arange(len(adjacent) + 1)).astype(np.int64), column)


def positive_matrix(pattern: Covisibility, border: int, seed: int) -> tuple[np.ndarray, ...]:
    """Blocks, border and corner of a positive definite matrix with the pattern, and the matrix itself."""
    rng = np.random.default_rng(seed)
    n = pattern.events
    blocks = rng.normal(size=(len(pattern.column), 6, 6))
    of_border = rng.normal(size=(n, 6, border))
    matrix = np.zeros((6 * n + border, 6 * n + border))
    for block, i, j in zip(blocks, pattern.row, pattern.column, strict=True):
        matrix[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = block
    matrix[: 6 * n, 6 * n :] = of_border.reshape(6 * n, border)
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    np.fill_diagonal(matrix, np.abs(matrix).sum(axis=1) + 1.0)
    diagonal = pattern.diagonal
    for i in range(n):
        blocks[diagonal[i]] = matrix[6 * i : 6 * i + 6, 6 * i : 6 * i + 6]
    return blocks, of_border, matrix[6 * n :, 6 * n :].copy(), matrix


def check(
    pattern: Covisibility, position: np.ndarray, border: int, largest_part: int, threads: int = 1
) -> None:
    blocks, of_border, corner, matrix = positive_matrix(pattern, border, seed=pattern.events)
    analysis = HelmertBlocking.of(pattern, position, largest_part)
    n = pattern.events
    # Powers of two: any scale gives the same solution and inverse, these without rounding.
    scale = np.exp2(np.random.default_rng(2).integers(-9, 9, 6 * n + border))
    factor = factorize_blocks(
        analysis, blocks, of_border, corner, scale[: 6 * n].reshape(n, 6), scale[6 * n :], threads
    )
    assert factor is not None
    rhs = np.random.default_rng(1).normal(size=6 * n + border)
    exposures, parameters = factor.solve(rhs[: 6 * n].reshape(n, 6), rhs[6 * n :])
    expected = np.linalg.solve(matrix, rhs)
    np.testing.assert_allclose(
        np.concatenate([exposures.ravel(), parameters]), expected, rtol=1e-10, atol=1e-13
    )
    many = np.random.default_rng(3).normal(size=(6 * n + border, 4))
    many[: 6 * n // 2, 1] = 0.0  # does not reach every front
    solved = np.linalg.solve(matrix, many)
    alone = np.zeros((6 * n + border, 3))
    alone[:6, 1:] = many[:6, :2]  # reaches few fronts
    for right in (many, alone):
        exposures, parameters = factor.solve(right[: 6 * n].reshape(n, 6, -1), right[6 * n :])
        expected = np.linalg.solve(matrix, right)
        found = np.concatenate([exposures.reshape(6 * n, -1), parameters])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    products, of_border = factor.products(many[: 6 * n].reshape(n, 6, 4).copy(), many[6 * n :])
    np.testing.assert_allclose(products, many.T @ solved, rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(of_border, solved[6 * n :], rtol=1e-9, atol=1e-12)
    inverse = np.linalg.inv(matrix)
    for wanted in (None, pattern_of(np.ones((n, n), dtype=bool))):
        found, found_border, found_corner = factor.inverse(wanted)
        every = wanted or pattern
        expected = inverse[: 6 * n, : 6 * n].reshape(n, 6, n, 6)[every.row, :, every.column]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-14)
        np.testing.assert_allclose(
            found_border.reshape(6 * n, border), inverse[: 6 * n, 6 * n :], rtol=1e-10, atol=1e-14
        )
        np.testing.assert_allclose(found_corner, inverse[6 * n :, 6 * n :], rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("largest_part", [1, 3, 10, 1000])
@pytest.mark.parametrize("border", [0, 1, 9])
@pytest.mark.parametrize(("strips", "length", "reach"), [(1, 1, 0), (1, 12, 2), (4, 9, 1), (6, 6, 2)])
def test_solution_and_selected_inverse_are_those_of_the_dense_matrix(
    strips: int, length: int, reach: int, border: int, largest_part: int
) -> None:
    check(*flight(strips, length, reach), border, largest_part)


def test_no_right_hand_sides_have_no_solutions() -> None:
    pattern, position = flight(2, 3, 1)
    blocks, of_border, corner, _ = positive_matrix(pattern, 2, seed=1)
    factor = factorize_blocks(
        HelmertBlocking.of(pattern, position, 3), blocks, of_border, corner, np.ones((6, 6)), np.ones(2), 1
    )
    assert factor is not None
    of_exposures, of_parameters = factor.solve(np.empty((6, 6, 0)), np.empty((2, 0)))
    assert of_exposures.shape == (6, 6, 0)
    assert of_parameters.shape == (2, 0)


def test_a_block_in_two_pieces_that_share_no_point_is_factorised() -> None:
    adjacent = np.zeros((12, 12), dtype=bool)
    adjacent[:6, :6] = adjacent[6:, 6:] = True
    position = np.column_stack([np.arange(12) * 100.0, np.zeros(12), np.zeros(12)])
    for border in (0, 2):
        check(pattern_of(adjacent), position, border, largest_part=4)


def test_exposures_at_one_place_are_dissected_too() -> None:
    """Positions only steer the cuts: useless ones cost time, never correctness."""
    pattern, _ = flight(4, 6, 1)
    check(pattern, np.zeros((24, 3)), 3, largest_part=4)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    images=st.integers(1, 30),
    density=st.floats(0.0, 0.5),
    border=st.integers(0, 4),
    largest_part=st.integers(1, 12),
)
def test_any_pattern_at_any_positions(
    seed: int, images: int, density: float, border: int, largest_part: int
) -> None:
    rng = np.random.default_rng(seed)
    pattern = pattern_of(rng.random((images, images)) < density)
    check(pattern, rng.normal(size=(images, 3)) * 1e3, border, largest_part)


def test_every_exposure_is_eliminated_once_and_parts_do_not_know_each_other() -> None:
    pattern, position = flight(12, 20, 2)
    dissection = dissect(pattern, position, largest_part=16)
    owned = np.concatenate([part.own for part in dissection.parts])
    np.testing.assert_array_equal(np.sort(owned), np.arange(pattern.events))
    part_of = np.empty(pattern.events, dtype=int)
    for index, part in enumerate(dissection.parts):
        part_of[part.own] = index
        assert index < part.parent or part.parent == -1
    for i, j in zip(pattern.row, pattern.column, strict=True):
        first, last = sorted((part_of[i], part_of[j]))
        while first != last and dissection.parts[first].parent >= 0:
            first = dissection.parts[first].parent
            if first >= last:
                break
        assert first == last, "two parts of which neither is above the other share a pair"


def test_fronts_of_one_step_do_not_need_each_other_and_follow_their_children() -> None:
    pattern, position = flight(12, 30, 2)
    analysis = HelmertBlocking.of(pattern, position, 8)
    done: set[int] = set()
    for step in analysis.steps:
        for portion in step:
            for index in portion:
                assert all(
                    child in done or child in portion[: index - portion[0]]
                    for child in analysis.children[index]
                )
        done.update(index for portion in step for index in portion)
    assert sorted(index for step in analysis.steps for portion in step for index in portion) == list(
        range(len(analysis.fronts))
    )
    assert len(analysis.steps[0]) > 4


def test_separators_of_a_regular_flight_are_about_as_wide_as_its_reach() -> None:
    pattern, position = flight(30, 60, 2)
    top = dissect(pattern, position).parts[-1]
    assert len(top.own) <= 2 * 30


def test_the_number_of_threads_does_not_change_a_bit() -> None:
    pattern, position = flight(10, 20, 2)
    blocks, of_border, corner, _ = positive_matrix(pattern, 5, seed=3)
    analysis = HelmertBlocking.of(pattern, position, 10)
    results = []
    for threads in (1, 2, 4):
        factor = factorize_blocks(
            analysis, blocks, of_border, corner, np.ones((pattern.events, 6)), np.ones(5), threads
        )
        assert factor is not None
        of_all = factor.inverse(pattern_of(np.ones((200, 200), dtype=bool)))
        results.append(b"".join(part.tobytes() for part in (*factor.inverse(), *of_all)))
    assert results[0] == results[1] == results[2]


@pytest.mark.parametrize("threads", [1, 2])
def test_an_inverse_that_is_kept_gives_other_blocks_as_the_factor_does(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pattern, position = flight(10, 20, 2)
    blocks, of_border, corner, _ = positive_matrix(pattern, 5, seed=3)
    analysis = HelmertBlocking.of(pattern, position, 10)
    factor = factorize_blocks(
        analysis, blocks, of_border, corner, np.ones((pattern.events, 6)), np.ones(5), threads
    )
    assert factor is not None
    wider = pattern_of(np.ones((200, 200), dtype=bool))
    expected = b"".join(part.tobytes() for part in factor.inverse(wider))
    with monkeypatch.context() as patched:
        patched.setattr(helmert_blocking, "_MOST_KEPT", 1_000)
        factor.inverse(keep=True)
    assert not factor.kept
    factor.inverse(keep=True)
    assert sorted(factor.kept) == list(range(len(analysis.fronts)))
    with monkeypatch.context() as patched:
        patched.setattr(dense_algebra, "invert_square", None)  # no front is inverted once more
        found = b"".join(part.tobytes() for part in factor.inverse(wider))
    assert found == expected


def test_a_matrix_that_is_not_positive_definite_has_no_factor() -> None:
    pattern, position = flight(3, 8, 1)
    blocks, of_border, corner, _ = positive_matrix(pattern, 2, seed=0)
    blocks[pattern.diagonal[11]] -= 2.0 * np.eye(6) * np.trace(blocks[pattern.diagonal[11]])
    analysis = HelmertBlocking.of(pattern, position, 4)
    scale = np.ones((pattern.events, 6))
    assert factorize_blocks(analysis, blocks, of_border, corner, scale, np.ones(2), 1) is None
