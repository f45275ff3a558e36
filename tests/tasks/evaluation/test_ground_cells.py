"""The grid of a trust map, its choice of cells, and interpolation between them."""

from __future__ import annotations

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.evaluation.trust_map import MapCells, MapGrid, _thinned, inside


def cells(rows: int, columns: int) -> MapCells:
    grid = MapGrid(100.0, 900.0, 10.0, rows, columns)
    return MapCells(
        grid, np.arange(rows * columns), np.column_stack([grid.middles, np.zeros(rows * columns)])
    )


@pytest.mark.parametrize(("extent", "cell"), [(10_000.0, 100.0), (7_300.0, 50.0), (480.0, 2.0), (0.3, 0.002)])
def test_cells_are_round_and_a_hundredth_of_the_block_or_less(extent: float, cell: float) -> None:
    grid = MapGrid.over(np.array([[0.0, 0.0], [extent, 0.4 * extent]]), None)
    assert grid.cell == pytest.approx(cell)


def test_the_grid_covers_all_points_with_corners_at_multiples_of_the_cell() -> None:
    points = np.array([[1003.0, 52.0, 7.0], [1101.0, 149.9, 8.0]])
    grid = MapGrid.over(points, 25.0)
    assert (grid.west, grid.north, grid.columns, grid.rows) == (1000.0, 150.0, 5, 4)
    np.testing.assert_allclose(grid.middles[[0, -1]], [[1012.5, 137.5], [1112.5, 62.5]])


def test_too_many_cells_are_refused_before_they_are_made() -> None:
    with pytest.raises(InputError, match="cells are possible"):
        MapGrid.over(np.array([[0.0, 0.0], [1e6, 1e6]]), 0.01)


@pytest.mark.parametrize("most", [1, 10, 300])
def test_chosen_cells_are_spread_and_not_too_many(most: int) -> None:
    chosen = cells(40, 60).spread(most)
    assert 1 <= len(chosen) <= max(most, 1)
    assert most < 10 or np.ptp(chosen // 60) > 10


def test_of_a_square_the_cell_in_its_middle_is_chosen() -> None:
    assert cells(9, 9).spread(1).tolist() == [4 * 9 + 4]


@pytest.mark.parametrize("shape", ["along", "across", "diagonal"])
def test_chosen_cells_follow_a_corridor(shape: str) -> None:
    rows, columns = {"along": (2, 2000), "across": (2000, 2), "diagonal": (2000, 2001)}[shape]
    of = MapGrid(0.0, 10.0 * rows, 10.0, rows, columns)
    along = np.arange(2000)
    number = along * columns + along + 1 if shape == "diagonal" else np.arange(rows * columns)
    chosen = MapCells(of, number, np.column_stack([of.middles[number], 0.0 * number])).spread(300)
    assert 150 <= len(chosen) <= 300
    # The next one of them is nowhere further than twice the distance at which 300 would stand.
    place = number[chosen] // columns if shape != "along" else number[chosen] % columns
    assert np.diff(np.sort(place), prepend=0, append=1999).max() <= 2 * 2000 / 150


def test_cells_farthest_outside_of_the_chosen_ones_are_added() -> None:
    of = cells(21, 31)
    inner = of.spread(30)
    assert len(of.with_margin(inner, 40)) == 40
    chosen = of.with_margin(inner, 300)
    assert set(inner) < set(chosen)
    assert {0, 30, 20 * 31, 20 * 31 + 30} <= set(chosen)
    plane = of.x_in_map[:, :1] * 0.3 - of.x_in_map[:, 1:2] * 0.1 + 5.0
    np.testing.assert_allclose(of.interpolated(chosen, plane[chosen]), plane, rtol=1e-9, atol=1e-9)


def test_chosen_cells_that_span_no_area_have_no_margin() -> None:
    of = cells(1, 50)
    np.testing.assert_array_equal(of.with_margin(of.spread(10), 30), of.spread(10))


def test_a_plane_is_interpolated_exactly_between_the_chosen_cells() -> None:
    of = cells(21, 31)
    plane = of.x_in_map[:, :1] * 0.3 - of.x_in_map[:, 1:2] * 0.1 + 5.0
    chosen = of.spread(30)
    found = of.interpolated(chosen, plane[chosen])
    inside = (
        (of.x_in_map[:, :2] > of.x_in_map[chosen, :2].min(axis=0))
        & (of.x_in_map[:, :2] < of.x_in_map[chosen, :2].max(axis=0))
    ).all(axis=1)
    np.testing.assert_allclose(found[inside], plane[inside], rtol=1e-9, atol=1e-9)
    assert np.isfinite(found).all()


def test_a_point_is_inside_a_polygon_with_a_bay() -> None:
    # A U: the bay between its arms is outside.
    corners = np.array([[0, 0], [6, 0], [6, 6], [4, 6], [4, 2], [2, 2], [2, 6], [0, 6]], dtype=np.float64)
    points = np.array([[1, 5], [3, 5], [5, 5], [3, 1], [-1, 1], [7, 1], [3, 7]], dtype=np.float64)
    expected = np.array([True, False, True, True, False, False, False])
    np.testing.assert_array_equal(inside(corners, points), expected)
    # The other way round, and beginning elsewhere, it is the same polygon.
    np.testing.assert_array_equal(inside(np.roll(corners[::-1], 3, axis=0), points), expected)


def test_a_slanting_side_divides_points_left_and_right_of_it() -> None:
    triangle = np.array([[100.0, 20.0], [104.0, 20.0], [100.0, 22.0]])
    points = np.array([[101.0, 21.4], [101.0, 21.6], [103.0, 20.4], [103.0, 20.6]])
    np.testing.assert_array_equal(inside(triangle, points), [True, False, True, False])


def test_points_that_lie_together_are_replaced_by_their_mean() -> None:
    alone, together = np.array([[0.0, 0.0, 5.0], [1000.0, 900.0, 7.0]]), np.array([[502.0, 502.0, 20.0]])
    around = np.array([[-0.3, 0.1, 1.0], [0.2, 0.3, -4.0], [0.4, -0.1, 9.0]])
    found = _thinned(np.concatenate([alone[:1], together + around, alone[1:]]))
    expected = np.concatenate([alone[:1], together + around.mean(axis=0), alone[1:]])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_beyond_the_chosen_cells_the_nearest_counts_also_for_what_is_not_finite() -> None:
    of = cells(5, 5)
    chosen = np.array([6, 8, 16, 18])
    values = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, np.inf]])
    found = of.interpolated(chosen, values)
    assert found[[0, 4, 20, 24]].tolist() == values.tolist()
    assert found[12, 0] == pytest.approx(2.5)
    assert np.isfinite(found[:, 0]).all()
    assert set(found[[13, 17, 19, 23], 1]) <= {2.0, 3.0, np.inf}


def test_points_at_opposite_ends_of_two_rows_stay_apart() -> None:
    points = np.array([[0.0, 0.0, 1.0], [300.0, 0.5, 2.0], [0.0, 1.5, 3.0]])
    np.testing.assert_array_equal(_thinned(points), points)
