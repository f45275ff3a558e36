"""Observation equations with unit weight matrix, and their columns of system parameters."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup


def whiten(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same observation equations with unit weight matrix.

    Where errors are correlated over time, every row also has the terms of the observation before.
    """
    alone, neighbours = standardize(group, equations), group.stochastic.neighbours
    return alone if neighbours is None else alone.combined(neighbours, neighbours.whitening)


def standardize(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same observation equations with every row multiplied by the W of its observation by itself."""
    whitener, diagonal = group.stochastic.whitener, group.stochastic.diagonal
    terms = tuple(
        type(term)(
            term.block,
            term.index,
            whitener @ term.jacobian if diagonal is None else diagonal[:, :, None] * term.jacobian,
        )
        for term in equations.terms
    )
    return Linearization(group.stochastic.standardized(equations.misclosure), terms)


def add_border_columns(of_border: Floats, columns: Ints, jacobian: Floats) -> None:
    """Scatter the Jacobian (n, m, d) of a family into (n, m, g); columns (n, d), −1 where held."""
    for component in range(columns.shape[1]):
        rows = np.flatnonzero(columns[:, component] >= 0)
        # Most families are held, and to index nothing takes as long as to index few.
        if rows.size:
            of_border[rows, :, columns[rows, component]] += jacobian[rows, :, component]
