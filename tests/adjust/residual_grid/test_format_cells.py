from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.residual_grid.format_cells import Division, FormatCells, Interpolation, Seams

HALF = (0.05, 0.03)


def _places(number: int = 4000) -> Floats:
    # Some lie on and beyond the border, as lens distortion and rounding bring them.
    return np.random.default_rng(2).uniform(-1.002, 1.002, (number, 2)) * HALF


def test_cells_are_numbered_row_by_row_from_the_corner_of_least_x_and_y() -> None:
    cells = FormatCells.of(HALF, 5)
    assert (cells.columns, cells.rows, cells.count) == (5, 5, 25)
    corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) * HALF
    np.testing.assert_array_equal(cells.cell_of(corners), [0, 4, 20, 24])
    np.testing.assert_array_equal(cells.cell_of(1.01 * corners), [0, 4, 20, 24])
    np.testing.assert_array_equal(cells.cell_of(cells.middles), np.arange(25))
    np.testing.assert_array_equal(cells.place[[0, 4, 20]], [[0, 0], [4, 0], [0, 4]])


def test_more_columns_than_rows_are_numbered_alike() -> None:
    cells = FormatCells(Division.of(0.05, 5), Division.of(0.03, 3))
    np.testing.assert_array_equal(cells.cell_of(cells.middles), np.arange(15))
    np.testing.assert_array_equal(cells.place[[4, 5, 14]], [[4, 0], [0, 1], [4, 2]])


def test_every_point_lies_between_the_edges_of_its_cell() -> None:
    cells = FormatCells.of(HALF, 7, Seams((-0.013, 0.02), (0.001,)))
    xy = np.clip(_places(), -np.array(HALF), HALF)
    column, row = cells.place[cells.cell_of(xy)].T
    for own, division, values in ((column, cells.along_x, xy[:, 0]), (row, cells.along_y, xy[:, 1])):
        assert np.all(division.edges[own] <= values)
        assert np.all(values <= division.edges[own + 1])


@given(
    half=st.floats(1e-3, 0.2),
    parts=st.integers(3, 60),
    places=st.tuples(st.floats(-0.95, -0.02), st.floats(0.02, 0.95)),
)
def test_no_part_lies_across_a_seam_and_all_are_alike_between_two(
    half: float, parts: int, places: tuple[float, float]
) -> None:
    seams = (half * places[0], half * places[1])
    division = Division.of(half, parts, seams)
    assert division.parts == parts
    assert (division.edges[0], division.edges[-1]) == (-half, half)
    assert set(seams) <= set(division.edges)
    widths = np.diff(division.edges)
    for tile in range(3):
        own = widths[division.tile == tile]
        assert len(own) >= 1
        np.testing.assert_allclose(own, own[0], rtol=1e-9, atol=1e-15)


def test_cells_are_as_equal_as_the_seams_allow() -> None:
    division = Division.of(0.06, 6, (0.02,))
    # 80 mm and 40 mm with six parts: four and two of 20 mm.
    np.testing.assert_allclose(np.diff(division.edges), 0.02)


@pytest.mark.parametrize("seams", [(0.01, 0.01), (0.02, -0.02), (0.06,), (-0.05,)])
def test_seams_that_do_not_fit_are_refused(seams: tuple[float, ...]) -> None:
    with pytest.raises(InconsistentBlockError, match="ascending"):
        Division.of(0.05, 9, seams)


def test_fewer_cells_than_ccd_images_are_refused() -> None:
    with pytest.raises(InconsistentBlockError, match="3 are required"):
        FormatCells.of(HALF, 2, Seams((-0.01, 0.01)))


@pytest.mark.parametrize("interpolation", ["bilinear", "cell"])
def test_a_constant_field_is_the_same_everywhere(interpolation: str) -> None:
    cells = FormatCells.of(HALF, 6, Seams((0.005,)))
    values = np.tile([1e-6, -2e-6], (cells.count, 1))
    found = cells.interpolate(values, _places(), interpolation)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, np.tile([1e-6, -2e-6], (4000, 1)), rtol=1e-14)


def test_bilinear_interpolation_is_exact_for_a_bilinear_field_between_the_middles() -> None:
    cells = FormatCells.of(HALF, 8)

    def field(xy: Floats) -> Floats:
        x, y = xy.T
        return np.stack([3.0 * x - y + 40.0 * x * y, 2.0 + x], axis=1)

    xy = _places()
    inside = np.all(np.abs(xy) < np.array(HALF) * 7 / 8, axis=1)
    found = cells.interpolate(field(cells.middles), xy, "bilinear")
    np.testing.assert_allclose(found[inside], field(xy[inside]), atol=1e-15)
    # Beyond the outermost middles it stays what it is there.
    nearest = np.clip(xy, -np.array(HALF) * 7 / 8, np.array(HALF) * 7 / 8)
    np.testing.assert_allclose(found, field(nearest), atol=1e-15)


def test_nothing_is_mixed_across_a_seam() -> None:
    cells = FormatCells.of(HALF, 9, Seams((-0.02, 0.015), (0.004,)))
    values = cells.tile[:, None] * np.array([1.0, -3.0])
    xy = _places()
    column = np.searchsorted([-0.02, 0.015], xy[:, 0], side="right")
    row = np.searchsorted([0.004], xy[:, 1], side="right")
    expected = (3 * row + column)[:, None] * np.array([1.0, -3.0])
    np.testing.assert_allclose(cells.interpolate(values, xy, "bilinear"), expected, rtol=1e-14)


def test_cells_without_a_value_take_no_part_and_nothing_is_corrected_where_none_has_one() -> None:
    cells = FormatCells.of(HALF, 10)
    values = np.full((cells.count, 2), np.nan)
    left = cells.place[:, 0] < 4
    values[left] = [5.0, 7.0]
    xy = _places()
    found = cells.interpolate(values, xy, "bilinear")
    known = xy[:, 0] < cells.along_x.edges[4]
    np.testing.assert_allclose(found[known], np.tile([5.0, 7.0], (known.sum(), 1)), rtol=1e-14)
    far = xy[:, 0] > cells.along_x.middles[4]
    np.testing.assert_array_equal(found[far], 0.0)


def test_the_same_cells_are_recognized_edge_by_edge() -> None:
    cells = FormatCells.of(HALF, 6)
    assert cells.same_as(FormatCells.of(HALF, 6))
    assert not cells.same_as(FormatCells.of(HALF, 7))
    assert not cells.same_as(FormatCells.of(HALF, 6, Seams((0.001,))))
    assert not cells.same_as(FormatCells.of((0.0501, 0.03), 6))


@pytest.mark.parametrize("interpolation", ["bilinear", "cell"])
def test_the_matrix_of_an_interpolation_does_the_same(
    interpolation: Interpolation,
) -> None:
    cells = FormatCells.of(HALF, 7, Seams((-0.013, 0.02), (0.001,)))
    random = np.random.default_rng(4)
    values = random.normal(size=(cells.count, 2))
    values[random.random((cells.count, 2)) < 0.3] = np.nan
    expected = cells.interpolate(values, _places(), interpolation)
    for k in (0, 1):
        matrix = cells.interpolation_matrix(np.isfinite(values[:, k]), _places(), interpolation)
        np.testing.assert_allclose(matrix @ np.nan_to_num(values[:, k]), expected[:, k], atol=1e-14)


def test_finer_cells_divide_every_cell_alike_and_keep_the_seams() -> None:
    cells = FormatCells.of(HALF, 7, Seams((-0.013, 0.02), (0.001,)))
    finer = cells.finer(3)
    assert (finer.columns, finer.rows) == (21, 21)
    np.testing.assert_allclose(finer.along_x.edges[::3], cells.along_x.edges, atol=1e-15)
    height = cells.along_y.edges[1] - cells.along_y.edges[0]
    np.testing.assert_allclose(np.diff(finer.along_y.edges[:4]), height / 3.0)
    own = cells.cell_of(finer.middles)
    np.testing.assert_array_equal(np.bincount(own), np.full(49, 9))
    np.testing.assert_array_equal(finer.tile, cells.tile[own])
    assert cells.finer(1).same_as(cells)
