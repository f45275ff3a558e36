"""The table of the trust map against what the mathematics says of the same cells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.adjustment import adjust_block
from adjust.options import AdjustmentOptions
from adjust.parameters import INTERIOR_ORIENTATION, ConsideredParameters, ParameterPlace
from adjust.trust_map.accuracy import NewMeasurement, cell_accuracy, joint_solution
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import GroundCells, sight_of
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_grid, local_from_map, map_from_local
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.evaluation.trust_map import MapCells, MapGrid, map_cells, new_sigma, write_trust_map
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.trust_map import TrustMapSettings
from tests.adjust.scenes import two_strips
from tests.adjust.trust_map.test_accuracy import corrections_of

NOTHING = np.zeros((0, 3))
NO_SURVEY = SurveyedPoints(
    (), np.zeros(0, dtype=bool), NOTHING, np.zeros(0), np.zeros((0, 3, 3)), NOTHING > 0.0
)
SIGMA0 = 1.3


@pytest.fixture(scope="module")
def adjusted() -> AdjustedBlock:
    scene = two_strips(noise_seed=5)
    focal_length = ParameterPlace(INTERIOR_ORIENTATION, 0, 0)
    known = ConsideredParameters((focal_length,), np.array([[(40e-6) ** 2]]))
    block = replace(scene.block, considered=known)
    result = adjust_block(block, scene.observations)
    result = replace(result, cofactor=replace(result.cofactor, corrections=corrections_of(block)))
    frame = MapFrame.of("EPSG:32632", ELLIPSOIDAL)
    return AdjustedBlock(block, result, frame, block.frame, SIGMA0, NO_SURVEY, pd.DataFrame())


def test_every_column_is_what_is_computed_of_its_cell(adjusted: AdjustedBlock, tmp_path: Path) -> None:
    grid = write_trust_map(tmp_path, adjusted, TrustMapSettings(cell_m=100.0))
    assert grid is not None
    table = pd.read_parquet(tmp_path / "trust_map_cells.parquet")
    assert 20 < len(table) == grid.cells < 300
    x_in_map = table[["x_m", "y_m", "z_m"]].to_numpy()
    np.testing.assert_allclose(x_in_map[:, 0], grid.west_m + (table["column"] + 0.5) * 100.0)
    np.testing.assert_allclose(x_in_map[:, 1], grid.north_m - (table["row"] + 0.5) * 100.0)
    place = {
        (row, column): k for k, (row, column) in enumerate(zip(table["row"], table["column"], strict=True))
    }
    neighbour = [place.get((row, column + 1), -1) for row, column in place]
    frames = adjusted.map_frame, adjusted.frame
    cells = GroundCells(
        local_from_map(*frames, x_in_map),
        np.ascontiguousarray(local_from_grid(*frames, x_in_map)),
        np.array(neighbour),
    )
    result = adjusted.result
    sight = sight_of(adjusted.block, result.state, cells.x_in_local)
    np.testing.assert_array_equal(table["rays"], sight.rays)
    assert sight.rays.min() == 2
    solution = joint_solution(result, sight)
    assert grid.added_pairs == solution.added_pairs > 0
    # Of all rays alike, and with the σ0 of the adjustment.
    sigma = float(result.groups[0].sigma[0, 0]) * SIGMA0
    assert grid.sigma_image_um == pytest.approx(1e6 * sigma)
    others = result.cofactor.considered, result.cofactor.corrections
    accuracy = cell_accuracy(solution, cells, sight, NewMeasurement(sigma, SIGMA0), *others)
    errors = block_errors(solution, result, cells, sight, np.arange(len(table)))
    for pattern, expected in (
        ("sigma_{}_m", accuracy.sigma),
        ("pair_sigma_{}_m", accuracy.sigma_of_pair),
        ("relative_sigma_{}_m", accuracy.sigma_relative),
        ("external_{}_m", accuracy.external),
        ("block_error_{}_m", errors.of_orientation),
        ("ray_error_{}_m", errors.of_rays),
    ):
        found = table[[pattern.format(axis) for axis in "xyz"]].to_numpy()
        np.testing.assert_allclose(found, expected, rtol=1e-6, err_msg=pattern)
    np.testing.assert_array_equal(table["uncontrolled"], accuracy.uncontrolled)


@pytest.mark.parametrize(
    ("number", "neighbour"), [([0, 1, 3, 4, 5], [1, -1, -1, 4, -1]), ([0, 1, 6], [1, -1, -1])]
)
def test_beyond_a_gap_in_a_row_and_in_the_next_row_there_is_no_neighbour(
    adjusted: AdjustedBlock, number: list[int], neighbour: list[int]
) -> None:
    grid = MapGrid(-200.0, 100.0, 100.0, 2, 4)
    x_in_map = np.column_stack([grid.middles[number], np.zeros(len(number))])
    assert MapCells(grid, np.array(number), x_in_map).ground(adjusted).neighbour.tolist() == neighbour


def test_cells_lie_on_the_ground_between_the_object_points(adjusted: AdjustedBlock) -> None:
    frames, state = (adjusted.map_frame, adjusted.frame), adjusted.result.state
    x_in_map = map_from_local(*frames, state.object_point)
    middle, slope = x_in_map[:, :2].mean(axis=0), np.array([0.1, -0.05])
    x_in_map[:, 2] = 300.0 + (x_in_map[:, :2] - middle) @ slope
    used = np.arange(len(x_in_map)) % 7 > 0
    x_in_map[~used, 2] += 500.0  # where wrong image points had put them
    on_slope = replace(state, object_point=local_from_map(*frames, x_in_map))
    result = replace(adjusted.result, state=on_slope, active_point=used)
    cells = map_cells(replace(adjusted, result=result), 100.0)
    assert cells is not None
    assert len(cells.number) > 20
    expected = 300.0 + (cells.x_in_map[:, :2] - middle) @ slope
    np.testing.assert_allclose(cells.x_in_map[:, 2], expected, atol=1e-6)


def test_a_stated_sigma_of_image_coordinates_is_in_micrometres(adjusted: AdjustedBlock) -> None:
    assert new_sigma(adjusted, TrustMapSettings(sigma_image_um=7.0)) == pytest.approx(7e-6)


def test_a_free_network_has_no_trust_map(adjusted: AdjustedBlock, tmp_path: Path) -> None:
    scene = two_strips(noise_seed=5, gnss=False, ins=False, control=())
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(free_network="both"))
    assert result.free_network is not None
    free = replace(adjusted, block=scene.block, result=result)
    assert write_trust_map(tmp_path, free, TrustMapSettings(cell_m=100.0)) is None
    assert not list(tmp_path.iterdir())


def test_a_free_network_that_leaves_nothing_open_has_a_trust_map(
    adjusted: AdjustedBlock, tmp_path: Path
) -> None:
    scene = two_strips(noise_seed=5)
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(free_network="both"))
    assert result.free_network is not None
    assert result.free_network.defect == 0
    free = replace(adjusted, block=scene.block, result=result)
    assert write_trust_map(tmp_path, free, TrustMapSettings(cell_m=200.0)) is not None
