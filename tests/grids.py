"""Grids of cases: every value is tested daily, every combination in the slow tests."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet


def pairs_daily(*axes: Sequence[Any]) -> list[ParameterSet]:
    """All combinations of three axes; daily all pairs of the first two, with one value of the third each.

    Along each of the first two, the values of the third take turns.
    """
    first, second, third = axes
    return [
        pytest.param(a, b, c, marks=() if (i + j) % len(third) == k else pytest.mark.slow)
        for (i, a), (j, b), (k, c) in product(enumerate(first), enumerate(second), enumerate(third))
    ]


def diagonal_daily(*axes: Sequence[Any]) -> list[ParameterSet]:
    """All combinations of the values of some axes; those off a diagonal that meets every value are slow."""
    daily = {tuple(k % len(axis) for axis in axes) for k in range(max(map(len, axes)))}
    return [
        pytest.param(*values, marks=() if place in daily else pytest.mark.slow)
        for place, values in zip(product(*(range(len(axis)) for axis in axes)), product(*axes), strict=True)
    ]
