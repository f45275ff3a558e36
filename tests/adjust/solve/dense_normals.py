"""The reduced normal matrix of a block in full, for comparison."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.solve.normal_equations import ReducedNormals


def dense_matrix(normals: ReducedNormals) -> Floats:
    """The reduced normal matrix S in full, (6 n + g, 6 n + g), symmetric."""
    n, g = normals.pattern.events, len(normals.rhs_border)
    matrix = np.zeros((6 * n + g, 6 * n + g))
    rows = 6 * normals.pattern.row[:, None, None] + np.arange(6)[:, None]
    columns = 6 * normals.pattern.column[:, None, None] + np.arange(6)
    matrix[rows, columns] = normals.blocks
    matrix[: 6 * n, 6 * n :] = normals.border.reshape(6 * n, g)
    matrix[6 * n :, 6 * n :] = normals.corner
    upper = np.triu(matrix)
    return upper + np.triu(upper, 1).T
