"""Noise of positions and attitudes that is correlated over time, from independent draws.

Standardized errors e of a first-order Gauss–Markov process (``gauss_markov``) along a strip are

    e_i = Σ_j≤i exp(−(t_i − t_j)/τ) √(1 − φ_j²) w_j

with independent w of unit variance and the correlation φ_j of exposure j with the one before it, 0 for the
first of a strip: every draw lives on in all later exposures of its strip. Images of several heads that share
a reading share its draws.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse

from adjust.arrays import Floats, Ints
from adjust.observations.base import StochasticModel


def correlated_noise(
    position: StochasticModel, attitude: StochasticModel, reading: Ints | None = None
) -> scipy.sparse.csr_array | None:
    """C (6 n, 6 n) with e = C w for the standardized errors of n images; None where all are independent.

    Parameters
    ----------
    position, attitude : of the positions and of the attitudes of all images, three components each;
        component k of image i has the row 6 i + k.
    reading : (n,) the image whose reading each image has; None: each its own.
    """
    n = len(position.sigma)
    draw = np.arange(n) if reading is None else reading
    if position.over_time is None and attitude.over_time is None and np.array_equal(draw, np.arange(n)):
        return None
    parts = [_triplets(model, 3 * half, draw) for half, model in enumerate((position, attitude))]
    row, column, value = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    size = 6 * n
    return scipy.sparse.csr_array(scipy.sparse.coo_array((value, (row, column)), shape=(size, size)))


def _triplets(model: StochasticModel, first: int, draw: Ints) -> tuple[Ints, Ints, Floats]:
    """Rows, columns and values of three components of every image, the first of them at 6 i + first."""
    later, earlier, value = _factor(model)
    component = first + np.arange(3)
    rows, columns = (6 * index[:, None] + component for index in (later, draw[earlier]))
    return rows.ravel(), columns.ravel(), np.repeat(value, 3)


def _factor(model: StochasticModel) -> tuple[Ints, Ints, Floats]:
    """Later image, earlier image and coefficient of every pair in a strip, an image with itself too."""
    n = len(model.sigma)
    process, neighbours = model.over_time, model.neighbours
    if process is None or neighbours is None:
        index = np.arange(n, dtype=np.int64)
        return index, index, np.ones(n)
    order = np.lexsort((process.time, process.strip))
    later, earlier = list[Ints](), list[Ints]()
    for own in np.split(order, np.flatnonzero(np.diff(process.strip[order])) + 1):
        i, j = np.tril_indices(len(own))
        later.append(own[i])
        earlier.append(own[j])
    one, other = np.concatenate(later), np.concatenate(earlier)
    age = (process.time[one] - process.time[other]) / process.correlation_time
    return one, other, np.exp(-age) * np.sqrt(neighbours.free_of_before[other])
