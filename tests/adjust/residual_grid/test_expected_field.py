"""The field that mean residuals speak for: closed forms, and fields of known variance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, optimize

from adjust.arrays import Floats
from adjust.residual_grid.expected_field import ExpectedField, Places, expected_field
from adjust.residual_grid.format_cells import FormatCells, Seams

HALF = (0.05, 0.04)
SEAMS = Seams((-0.02, 0.02), (0.0,))


def expected(cells: FormatCells, means: Floats, response: Floats, noise: Floats) -> ExpectedField:
    places = Places(cells, np.ones((2, cells.count), dtype=bool))
    return expected_field([places], means, response, noise, np.eye(len(means)))


def drawn(cells: FormatCells, length: float, across: bool, seed: int) -> Floats:
    """A field of variance 1 (2 k,), its correlations formed from their definition."""
    random = np.random.default_rng(seed)
    apart = np.linalg.norm(cells.middles[:, None] - cells.middles, axis=2) / (2.0 * max(HALF))
    same = across | (cells.tile[:, None] == cells.tile)
    correlation = np.where(same, np.exp(-((apart / length) ** 2)), 0.0)
    lower = np.linalg.cholesky(correlation + 1e-9 * np.eye(cells.count))
    return np.concatenate([lower @ random.normal(size=cells.count) for _ in range(2)])


def drawn_radial(cells: FormatCells, seed: int) -> Floats:
    """A radial field (2 k,) of variance 1 at the outermost middles, RMS about 0.6."""
    distance = np.linalg.norm(cells.middles, axis=1)
    relative, apart = distance / distance.max(), (distance[:, None] - distance) / (2.0 * max(HALF))
    correlation = np.outer(relative, relative) * np.exp(-((apart / 0.25) ** 2))
    lower = np.linalg.cholesky(correlation + 1e-9 * np.eye(cells.count))
    size = lower @ np.random.default_rng(seed).normal(size=cells.count)
    return np.asarray((size[:, None] * cells.middles / np.maximum(distance, 1e-9)[:, None]).T.ravel())


def test_a_radial_field_is_found_where_its_shape_alone_tells_it() -> None:
    # What is left of a field in the means is far below its size where the block imitates most of it.
    cells, squares, part = FormatCells.of(HALF, 9, SEAMS), list[float](), list[float]()
    c = 2 * cells.count
    for seed in range(12):
        random, true = np.random.default_rng(200 + seed), 4.0 * drawn_radial(cells, seed)
        found = expected(cells, 0.2 * true + random.normal(0.0, 0.2, c), 0.2 * np.eye(c), 0.04 * np.eye(c))
        error = found.value - true
        squares.append(float(np.mean(error**2) / np.mean(np.sum(found.root**2, axis=1))))
        part.append(float(np.mean(error**2) / np.mean(true**2)))
    assert np.median(part) < 0.1
    assert 0.6 < np.mean(squares) < 1.4


def test_one_sub_area_has_no_radial_field() -> None:
    cells = FormatCells.of(HALF, 1)
    found = expected(cells, np.array([3.0, -2.0]), np.eye(2), 0.01 * np.eye(2))
    np.testing.assert_allclose(found.value, [3.0, -2.0], atol=0.1)


@pytest.mark.parametrize(("length", "across"), [(0.6, True), (0.25, True), (0.6, False), (0.1, False)])
def test_a_field_is_found_within_its_covariance(length: float, across: bool) -> None:
    cells, squares, sigma = FormatCells.of(HALF, 9, SEAMS), list[float](), list[float]()
    c = 2 * cells.count
    for seed in range(12):
        random = np.random.default_rng(100 + seed)
        true = 2.0 * drawn(cells, length, across, seed)
        found = expected(cells, true + random.normal(0.0, 0.5, c), np.eye(c), 0.25 * np.eye(c))
        error = found.value - true
        squares.append(float(np.mean(error**2) / np.mean(np.sum(found.root**2, axis=1))))
        sigma.append(found.sigma)
    assert 0.75 < np.mean(squares) < 1.25
    assert 1.4 < np.mean(sigma) < 2.6


@pytest.mark.parametrize("noise", [0.04, 4e-6])
def test_what_no_mean_shows_keeps_its_variance(noise: float) -> None:
    # The response leaves out the shift of x: everything else is as good as known.
    cells = FormatCells.of(HALF, 9)
    k, true = cells.count, 3.0 * drawn(cells := FormatCells.of(HALF, 9), 0.25, True, 4)
    shift = np.concatenate([np.full(k, 1.0 / np.sqrt(k)), np.zeros(k)])
    response = np.eye(2 * k) - np.outer(shift, shift)
    found = expected(cells, response @ true, response, noise * response)
    spread = found.root.T @ shift
    error = found.value - true
    assert np.sqrt(np.mean((error - shift * (shift @ error)) ** 2)) < 0.4
    # Of the mean of correlated values much remains: the variance of a mean of the format.
    assert 0.05 < float(spread @ spread) / k < found.sigma**2
    assert abs(float(shift @ error)) < 3.0 * float(np.sqrt(spread @ spread))


def test_noise_alone_is_no_signal() -> None:
    cells = FormatCells.of(HALF, 9, SEAMS)
    c = 2 * cells.count
    found = [
        expected(cells, np.random.default_rng(seed).normal(size=c), np.eye(c), np.eye(c)) for seed in range(6)
    ]
    assert np.mean([item.sigma for item in found]) < 0.3
    assert max(float(np.mean(np.sum(item.root**2, axis=1))) for item in found) < 0.1


def test_scale_and_units_do_not_matter() -> None:
    cells = FormatCells.of(HALF, 8, SEAMS)
    c = 2 * cells.count
    means = drawn(cells, 0.25, True, 1) + np.random.default_rng(1).normal(0.0, 0.3, c)
    one = expected(cells, means, np.eye(c), 0.09 * np.eye(c))
    other = expected(cells, 1e-6 * means, np.eye(c), 0.09e-12 * np.eye(c))
    assert other.sigma == pytest.approx(1e-6 * one.sigma, rel=1e-3)
    np.testing.assert_allclose(1e6 * other.value, one.value, atol=2e-3)


@pytest.mark.parametrize("number", [1, 2])
def test_where_parameters_imitate_nearly_everything_nothing_is_made_up(number: int) -> None:
    cells = FormatCells.of(HALF, number)
    c, means = 2 * cells.count, np.random.default_rng(3).normal(size=2 * cells.count)
    known = np.ones((2, cells.count), dtype=bool)
    nothing = expected_field([Places(cells, known)], means, np.eye(c), np.eye(c), np.zeros((c, c)))
    assert nothing.sigma == 0.0
    assert not np.any(nothing.value)
    hardly = expected_field([Places(cells, known)], means, np.eye(c), np.eye(c), 1e-9 * np.ones((c, c)))
    assert hardly.sigma == 0.0


def correlations(cells: FormatCells) -> list[Floats]:
    """Correlation matrices (2 k, 2 k) of all fields of a set, written down from the module's text."""
    side, k = 2.0 * max(HALF), cells.count
    apart = np.linalg.norm(cells.middles[:, None] - cells.middles, axis=2)
    found = list[Floats]()
    for same in (np.ones((k, k)), cells.tile[:, None] == cells.tile)[: 1 + cells.tile.any()]:
        for length in (0.1, 0.25, 0.6):
            found.append(np.kron(np.eye(2), same * np.exp(-((apart / side / length) ** 2))))
    distance = np.linalg.norm(cells.middles, axis=1)
    relative, outwards = distance / distance.max(), (cells.middles.T / distance).ravel()
    radial = np.exp(-(((distance[:, None] - distance) / side / 0.25) ** 2)) * np.outer(relative, relative)
    return [*found, np.outer(outwards, outwards) * np.tile(radial, (2, 2))]


def test_what_means_do_not_tell_has_a_limit() -> None:
    cells = FormatCells.of(HALF, 6, SEAMS)
    c = 2 * cells.count
    means = np.random.default_rng(3).normal(size=c)
    found = expected(cells, means, np.zeros((c, c)), np.eye(c))
    np.testing.assert_allclose(found.value, 0.0, atol=1e-9)
    # Of every field, a hundred times the mean square of the means.
    covariance = found.root @ found.root.T / (100.0 * np.mean(means**2))
    np.testing.assert_allclose(covariance, np.sum(correlations(cells), axis=0), atol=2e-3)


def test_of_two_sets_it_is_the_most_probable_of_full_matrices() -> None:
    random = np.random.default_rng(5)
    sets = (FormatCells.of(HALF, 4, Seams((0.01,), ())), FormatCells.of(HALF, 2))
    first, c = 2 * sets[0].count, 2 * (sets[0].count + sets[1].count)
    each = [linalg.block_diag(own, np.zeros((c - first, c - first))) for own in correlations(sets[0])]
    each += [linalg.block_diag(np.zeros((first, first)), own) for own in correlations(sets[1])]
    response = np.eye(c) + 0.05 * random.normal(size=(c, c))
    noise = linalg.block_diag(0.2 * np.eye(first), 0.3 * np.eye(c - first)) + 0.05
    signal = 3.0 * each[5] + 2.0 * each[6] + 1.5 * each[-2] + 1e-9 * np.eye(c)
    true = np.linalg.cholesky(signal) @ random.normal(size=c)
    means = response @ true + np.linalg.cholesky(noise) @ random.normal(size=c)

    def less(covariance: Floats) -> float:
        """−2 log of the probability, but for a constant."""
        of_means = response @ covariance @ response.T + noise
        return float(np.linalg.slogdet(of_means)[1] + means @ np.linalg.solve(of_means, means))

    def with_variances(logarithms: Floats) -> Floats:
        return np.asarray(np.tensordot(np.exp(logarithms), each, axes=1))

    most = optimize.minimize(
        lambda logarithms: less(with_variances(logarithms)), np.zeros(len(each)), method="L-BFGS-B",
        bounds=[(-14.0, 6.0)] * len(each),
    )  # fmt: skip
    covariance = with_variances(most.x)
    gain = covariance @ response.T @ np.linalg.inv(response @ covariance @ response.T + noise)
    places = [Places(cells, np.ones((2, cells.count), dtype=bool)) for cells in sets]
    found = expected_field(places, means, response, noise, np.eye(c))
    assert found.evidence > 20.0
    assert found.evidence == pytest.approx(less(np.zeros((c, c))) - most.fun, abs=0.05)
    left = covariance - gain @ response @ covariance
    np.testing.assert_allclose(found.value, gain @ means, atol=0.05)
    np.testing.assert_allclose(found.root @ found.root.T, left, atol=0.05)
    squares = (gain @ means) ** 2 + np.diagonal(left)
    assert found.sigma == pytest.approx(np.sqrt(squares.mean()), rel=0.02)
    assert found.sigma_of(slice(first, c)) == pytest.approx(np.sqrt(squares[first:].mean()), rel=0.02)
