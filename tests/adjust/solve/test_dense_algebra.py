"""Dense algebra in place against numpy, also on parts of larger matrices."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from adjust.solve import dense_algebra


def positive(size: int, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed).normal(size=(size, size))
    return np.asfortranarray(random @ random.T + size * np.eye(size))


@pytest.mark.parametrize(("p", "q"), [(1, 0), (1, 1), (6, 0), (7, 12), (40, 3), (0, 5)])
def test_a_front_is_eliminated(p: int, q: int) -> None:
    matrix = positive(p + q)
    columns, rest = matrix[:, :p].copy(order="F"), matrix[p:, p:].copy(order="F")
    assert dense_algebra.factorize_columns(columns)
    lower, below = columns[:p], columns[p:]
    dense_algebra.subtract_square(rest, below)
    expected = np.linalg.cholesky(matrix)
    np.testing.assert_allclose(np.tril(lower), expected[:p, :p], rtol=1e-12)
    np.testing.assert_allclose(below, expected[p:, :p], rtol=1e-12)
    complement = expected[p:, p:] @ expected[p:, p:].T
    np.testing.assert_allclose(np.tril(rest), np.tril(complement), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize(("p", "q"), [(1, 1), (7, 12), (40, 3), (5, 0), (0, 5)])
def test_a_front_is_inverted_in_place_of_its_parts(p: int, q: int) -> None:
    matrix = positive(p + q)
    columns = matrix[:, :p].copy(order="F")
    assert dense_algebra.factorize_columns(columns)
    expected = np.linalg.inv(matrix)
    inverse = np.full((p + q, p + q), np.nan, order="F")
    inverse[p:, p:] = np.tril(expected[p:, p:])
    inverse[:p, :p] = 0.0
    square, side, rest = inverse[:p, :p], inverse[p:, :p], inverse[p:, p:]
    dense_algebra.invert_square(columns[:p], square)
    gain = dense_algebra.times_inverse(columns[p:], columns[:p])
    dense_algebra.negative_product(rest, gain, side)
    dense_algebra.subtract_product(square, gain, side)
    np.testing.assert_allclose(np.tril(inverse), np.tril(expected), rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("right", [(), (1,), (7,)])
@pytest.mark.parametrize("size", [1, 9, 65, 150])
def test_triangular_systems_are_solved_both_ways(size: int, right: tuple[int, ...]) -> None:
    columns = positive(size)
    assert dense_algebra.factorize_columns(columns)
    lower, x = np.tril(columns), np.random.default_rng(5).normal(size=(size, *right))
    forward, backward = x.copy(), x.copy()
    dense_algebra.solve_lower(columns, forward)
    dense_algebra.solve_lower_transposed(columns, backward)
    np.testing.assert_allclose(lower @ forward, x)
    np.testing.assert_allclose(lower.T @ backward, x)


def test_a_matrix_that_is_not_positive_is_refused() -> None:
    matrix = positive(8)
    matrix[5, 5] = -1.0
    assert not dense_algebra.factorize_columns(matrix)


def test_a_matrix_in_the_wrong_order_is_refused() -> None:
    with pytest.raises(ValueError, match="contiguous"):
        dense_algebra.factorize_columns(np.ascontiguousarray(positive(8)))


def test_fronts_on_several_threads_have_the_bytes_of_one_thread() -> None:
    def work(seed: int) -> bytes:
        columns = positive(180, seed)[:, :90].copy(order="F")
        assert dense_algebra.factorize_columns(columns)
        return columns.tobytes()

    alone = [work(seed) for seed in range(12)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(12))) == alone
