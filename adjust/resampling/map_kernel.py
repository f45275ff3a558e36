"""Positions in the source of pixels of an image, compiled: see ``pixel_map``."""

import numpy as np

from adjust.compiled import kernel, small_kernel

_COARSE, _FINE = 64, 8


@small_kernel
def along_nodes(nodes, i, j, v, side, x, y, start):
    """Positions of ``side`` pixels from node j to the next, v of the way from row i of nodes to the next."""
    left_x = nodes[i, j, 0] + v * (nodes[i + 1, j, 0] - nodes[i, j, 0])
    left_y = nodes[i, j, 1] + v * (nodes[i + 1, j, 1] - nodes[i, j, 1])
    step_x = nodes[i, j + 1, 0] + v * (nodes[i + 1, j + 1, 0] - nodes[i, j + 1, 0]) - left_x
    step_y = nodes[i, j + 1, 1] + v * (nodes[i + 1, j + 1, 1] - nodes[i, j + 1, 1]) - left_y
    for k in range(side):
        x[start + k] = left_x + k / side * step_x
        y[start + k] = left_y + k / side * step_y


@kernel
def positions_of_cell(row, j, nodes, divided, fine, divided_again, finest, x, y):
    """Columns x (64,) and rows y (64,) in the source of the pixels of a row in cell j; NaN: none."""
    i = row // _COARSE
    cell, below = divided[i, j], row - i * _COARSE
    if cell < 0:
        along_nodes(nodes, i, j, below / _COARSE, _COARSE, x, y, 0)
        return
    i = below // _FINE
    below -= i * _FINE
    for k in range(_COARSE // _FINE):
        part = divided_again[cell, i, k]
        if part < 0:
            along_nodes(fine[cell], i, k, below / _FINE, _FINE, x, y, k * _FINE)
        else:
            for c in range(_FINE):
                x[k * _FINE + c] = finest[part, below, c, 0]
                y[k * _FINE + c] = finest[part, below, c, 1]


@kernel
def map_positions(column, row, nodes, divided, fine, divided_again, finest, found):
    """The positions found (n, 2) of pixels (n,), (n,)."""
    x, y = np.empty(_COARSE), np.empty(_COARSE)
    for k in range(len(column)):
        j = column[k] // _COARSE
        positions_of_cell(row[k], j, nodes, divided, fine, divided_again, finest, x, y)
        found[k, 0], found[k, 1] = x[column[k] - j * _COARSE], y[column[k] - j * _COARSE]
