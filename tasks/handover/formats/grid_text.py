"""Distortion grids as text: the ``gridgroup`` of ImageStation, which Catalyst and BINGO have, too, and plain tables.

| file | a row |
|---|---|
| ``*.dat`` | x' y' x y in mm: where a node is moved to, then the node; x fastest, from the lower left |
| ``*.csv`` | camera, column, row, x_mm, y_mm of the node, dx_um, dy_um to be added |

The image system counts from the centre of the format, x right, y up. Which direction a program applies was not yet seen, so both are
written: from measured to ideal points, and from ideal to measured ones.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tasks.handover.delivery import Delivery, Files
from tasks.handover.distortion_grid import CameraGrids, DistortionGrid
from tasks.handover.formats.corrected_csv import cameras_csv
from tasks.handover.formats.numbers import fixed_rows, table
from tasks.handover.formats.short_names import without_blanks

_DECIMALS_MM, _DECIMALS_UM = 6, 4
_DIRECTIONS = {
    "ideal_from_measured": "nodes are measured points, moved to ideal ones",
    "measured_from_ideal": "nodes are ideal points, moved to measured ones",
}


def write_distortion_grids(delivery: Delivery) -> Files:
    """``cameras.csv`` and the tables of both directions."""
    head = ["camera", "column", "row", "x_mm", "y_mm", "dx_um", "dy_um"]
    tables = {f"{direction}.csv": table(head, _rows(delivery.grids, direction)) for direction in _DIRECTIONS}
    return {"cameras.csv": cameras_csv(delivery), **tables}


def _rows(grids: Sequence[CameraGrids], direction: str) -> Iterator[list[object]]:
    for one in grids:
        grid: DistortionGrid = getattr(one, direction)
        nodes = grid.nodes.reshape(-1, 2)
        at = fixed_rows(1e3 * nodes, _DECIMALS_MM)
        shift = fixed_rows(1e6 * (grid.moved.reshape(-1, 2) - nodes), _DECIMALS_UM)
        for k, cells in enumerate(zip(at, shift, strict=True)):
            row, column = divmod(k, len(grid.x))
            yield [one.camera, column, row, *cells[0], *cells[1]]


def gridgroups(delivery: Delivery) -> Files:
    """``ideal_from_measured.dat`` and ``measured_from_ideal.dat`` of the cameras that have any correction."""
    chosen = [one for one in delivery.grids if one.moves]
    if not chosen:
        return {}
    name_of = dict(
        zip((one.frame.name for one in delivery.results.cameras), camera_words(delivery), strict=True)
    )
    return {
        f"{direction}.dat": "\n".join(
            line for one in chosen for line in _group(one, name_of[one.camera], direction)
        )
        + "\n"
        for direction in _DIRECTIONS
    }


def camera_words(delivery: Delivery) -> list[str]:
    """Names of the cameras in grids and in the files that refer to them."""
    return without_blanks([camera.frame.name for camera in delivery.results.cameras], '"')


def _group(grids: CameraGrids, name: str, direction: str) -> list[str]:
    grid: DistortionGrid = getattr(grids, direction)
    rows = fixed_rows(1e3 * np.concatenate([grid.moved, grid.nodes], axis=2).reshape(-1, 4), _DECIMALS_MM)
    return [
        f'begin gridgroup "{name}"',
        " enabled: yes",
        " order_index: 0",
        f' camera_name: "{name}"',
        f' description: "{_DIRECTIONS[direction]}; additional parameters and mean residuals"',
        f' begin grid "{name} 1"',
        "  enabled: yes",
        "  inverse_scale: 1.000000",
        f"  columns: {len(grid.x)}",
        f"  rows: {len(grid.y)}",
        f'  description: "{_DIRECTIONS[direction]}"',
        "  begin gridpoints",
        *("   " + " ".join(f"{cell:>12}" for cell in row) for row in rows),
        "  end gridpoints",
        " end grid",
        "end gridgroup",
    ]
