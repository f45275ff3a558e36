"""What an adjustment found, one row for each unknown: value, standard deviation, unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from adjust.arrays import Floats
from adjust.quality.considered import with_considered
from adjust.quality.picture_cofactor import picture_cofactors

if TYPE_CHECKING:
    from adjust.result import AdjustmentResult


class ParameterRow(NamedTuple):
    """One estimated system parameter, in SI units and radians, or the own unit of its set."""

    name: str
    entity: str
    value: float
    sigma: float
    unit: str


def parameter_rows(result: AdjustmentResult, sigma0: float | None = None) -> list[ParameterRow]:
    """Every estimated system parameter, with the errors of considered parameters in its σ."""
    factor = result.sigma0 if sigma0 is None else sigma0
    cofactor = with_considered(result.cofactor, factor).reduced.corner
    sigma = factor * np.sqrt(np.diagonal(cofactor))
    values = np.concatenate(
        [result.state.system[item.family.name][item.free] for item in result.layout.system] or [np.zeros(0)]
    )
    return [
        ParameterRow(name, entity, float(values[column]), float(sigma[column]), unit)
        for column, (name, entity, unit) in enumerate(result.layout.border_names())
    ]


def sigma_of_images(result: AdjustmentResult, sigma0: float | None = None) -> Floats:
    """(n, 6) of every projection centre, local axes, m, and small rotation in the camera frame, rad."""
    factor = result.sigma0 if sigma0 is None else sigma0
    return _sigma(factor, picture_cofactors(result.state, result.layout, result.cofactor, factor))


def sigma_of_points(result: AdjustmentResult, sigma0: float | None = None) -> Floats:
    """(m, 3) of every object point, local axes, m; NaN for those that were not used."""
    factor = result.sigma0 if sigma0 is None else sigma0
    return _sigma(factor, with_considered(result.cofactor, factor).of_points)


def _sigma(factor: float, blocks: Floats) -> Floats:
    return np.asarray(factor * np.sqrt(np.diagonal(blocks, axis1=1, axis2=2)))
