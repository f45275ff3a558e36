"""Which system parameters a block cannot separate: pairs, and combinations of more."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import Quantity
from tasks.results.figures import WeakParameters

# Two parameters correlated by more than this are hardly separated; it is also 1 − λ of the weakest direction.
CORRELATED = 0.98
# Part of a direction (unit length) from which a parameter is named.
_INVOLVED = 0.3
_MOST_PAIRS, _MOST_MODES = 5, 3


def weak_parameters(parameters: tuple[Quantity, ...], correlation: Floats) -> tuple[WeakParameters, ...]:
    """Pairs, the most correlated first, and combinations that contain none of them.

    Parameters
    ----------
    correlation : (g, g) of the parameters.
    """
    if len(parameters) < 2:
        return ()
    pairs = _pairs(correlation)
    explained = {frozenset(pair) for pair in pairs}
    modes = [
        members for members in _modes(correlation) if not any(pair <= set(members) for pair in explained)
    ]
    return (
        *(_figure([parameters[a], parameters[b]], float(correlation[a, b])) for a, b in pairs),
        *(_figure([parameters[k] for k in members]) for members in modes),
    )


def _figure(members: list[Quantity], correlation: float | None = None) -> WeakParameters:
    return WeakParameters(
        parameters=tuple(item.name for item in members),
        entities=tuple(item.entity for item in members),
        correlation=correlation,
    )


def _pairs(correlation: Floats) -> list[tuple[int, int]]:
    """The most strongly correlated pairs, strongest first."""
    first, second = np.triu_indices(len(correlation), 1)
    size = np.abs(correlation[first, second])
    order = np.argsort(-size, kind="stable")[:_MOST_PAIRS]
    return [(int(first[k]), int(second[k])) for k in order if size[k] > CORRELATED]


def _modes(correlation: Floats) -> list[tuple[int, ...]]:
    """Parameters of the weakest directions of the correlation matrix, weakest direction first."""
    values, vectors = np.linalg.eigh(correlation)
    weak = [k for k in range(len(values)) if values[k] < 1.0 - CORRELATED][:_MOST_MODES]
    return [tuple(int(i) for i in np.flatnonzero(np.abs(vectors[:, k]) >= _INVOLVED)) for k in weak]
