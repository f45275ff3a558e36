"""residual_grid.parquet: complete in itself, and refused where it does not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.camera.interior import FrameCamera
from adjust.residual_grid.comparison import combined_grid
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.residual_grid import ResidualGrid, residual_grid
from tasks.block.residual_grid_cells import residual_grid_cells
from tasks.block.residual_grid_file import read_corrections, write_residual_grid
from tasks.errors import InputError

CAMERA = FrameCamera("C", 4000, 3000, 5e-6, 0.05, (1e-4, -2e-4), "corner", 0)
OTHER = FrameCamera("D", 3000, 4000, 5e-6, 0.05, (0.0, 0.0), "corner", 90)
SEAMS = Seams((-0.003, 0.004), (0.001,))
USED = np.array([True])


def _grid(seed: int, cells: FormatCells | None = None, points: int = 900) -> ResidualGrid:
    random = np.random.default_rng(seed)
    cells = cells or FormatCells.of(CAMERA.half_format, 8, SEAMS)
    xy = random.uniform(-1, 1, (points, 2)) * CAMERA.half_format
    return residual_grid(cells, xy, random.normal(0.3e-6, 1e-6, (points, 2)))


def _field(grid: ResidualGrid) -> CorrectionField:
    return CorrectionField(grid.cells, 2.5 * grid.mean)


def _written(folder: Path, grid: ResidualGrid, field: CorrectionField | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    write_residual_grid(folder, (CAMERA,), (grid,), (field,), 0.95)
    return folder / "residual_grid.parquet"


def test_the_file_says_what_the_grid_is(tmp_path: Path) -> None:
    grid = _grid(1, points=350)
    table = pd.read_parquet(_written(tmp_path, grid, _field(grid))).sort_values(["row", "column"])
    assert len(table) == 64
    np.testing.assert_array_equal(table[["count_vx", "count_vy"]], grid.count)
    np.testing.assert_array_equal(table["count"], grid.count.max(axis=1))
    np.testing.assert_allclose(table[["x_mm", "y_mm"]], grid.cells.middles * 1e3)
    np.testing.assert_allclose(table[["mean_vx_um", "mean_vy_um"]], grid.mean * 1e6)
    np.testing.assert_allclose(table[["sigma_vx_um", "sigma_vy_um"]], grid.sigma * 1e6)
    np.testing.assert_allclose(table["sigma"], np.sqrt(np.mean(grid.sigma**2, axis=1)) * 1e6)
    np.testing.assert_array_equal(table["significant"], grid.significant(0.95))
    np.testing.assert_allclose(table["correction_x_um"], 2.5 * grid.mean[:, 0] * 1e6)
    assert table["mean_vx_um"].isna().sum() == (~grid.known).sum() > 0


def test_the_cells_come_back_with_their_seams(tmp_path: Path) -> None:
    grid = _grid(1)
    cells = residual_grid_cells(pd.read_parquet(_written(tmp_path, grid)))
    assert cells.same_as(grid.cells, 1e-12)
    np.testing.assert_array_equal(cells.tile, grid.cells.tile)


def test_the_means_of_a_run_without_corrections_become_corrections(tmp_path: Path) -> None:
    grid = _grid(2)
    (field,) = read_corrections((_written(tmp_path, grid),), (CAMERA,), USED)
    assert field is not None
    np.testing.assert_allclose(field.value, grid.mean, atol=1e-18)


def test_a_run_that_applied_corrections_hands_on_these_and_not_what_is_left(tmp_path: Path) -> None:
    grid = _grid(2)
    (field,) = read_corrections((_written(tmp_path, grid, _field(grid)),), (CAMERA,), USED)
    assert field is not None
    np.testing.assert_allclose(field.value[grid.known], 2.5 * grid.mean[grid.known], atol=1e-18)


def test_several_files_are_averaged_with_their_weights(tmp_path: Path) -> None:
    one, other = _grid(3), _grid(4, points=2500)
    files = (_written(tmp_path / "a", one), _written(tmp_path / "b", other))
    (field,) = read_corrections(files, (CAMERA,), USED)
    assert field is not None
    np.testing.assert_allclose(field.value, combined_grid((one, other)).mean, atol=1e-17)


def test_a_camera_without_image_points_needs_no_correction(tmp_path: Path) -> None:
    file = _written(tmp_path, _grid(1))
    fields = read_corrections((file,), (CAMERA, OTHER), np.array([True, False]))
    assert fields[1] is None


def test_a_camera_that_is_not_in_the_file_is_named(tmp_path: Path) -> None:
    file = _written(tmp_path, _grid(1))
    with pytest.raises(InputError, match="has no camera 'D'") as error:
        read_corrections((file,), (OTHER,), USED)
    assert "'C'" in error.value.remedy
    assert error.value.file == file


def test_another_image_format_is_refused(tmp_path: Path) -> None:
    file = _written(tmp_path, _grid(1))
    turned = FrameCamera("C", 3000, 4000, 5e-6, 0.05, (0.0, 0.0), "corner", 0)
    with pytest.raises(InputError, match="another image format") as error:
        read_corrections((file,), (turned,), USED)
    assert "3000 × 4000" in error.value.remedy


def test_files_with_different_sub_areas_cannot_be_averaged(tmp_path: Path) -> None:
    files = (
        _written(tmp_path / "a", _grid(1)),
        _written(tmp_path / "b", _grid(1, FormatCells.of(CAMERA.half_format, 8))),
    )
    with pytest.raises(InputError, match="different sub-areas"):
        read_corrections(files, (CAMERA,), USED)


def test_what_is_not_a_residual_grid_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("mean residuals")
    table = tmp_path / "other.parquet"
    pd.DataFrame({"camera": ["C"]}).to_parquet(table)
    for file in (text, table):
        with pytest.raises(InputError, match=r"not a Parquet table|not a table 'residual_grid'"):
            read_corrections((file,), (CAMERA,), USED)
