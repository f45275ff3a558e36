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


def parameter_rows(result: AdjustmentResult) -> list[ParameterRow]:
    """Every estimated system parameter, with the errors of considered parameters in its σ."""
    cofactor = with_considered(result.cofactor, result.sigma0).reduced.corner
    sigma = result.sigma0 * np.sqrt(np.diagonal(cofactor))
    values = np.concatenate(
        [result.state.system[item.family.name][item.free] for item in result.layout.system] or [np.zeros(0)]
    )
    return [
        ParameterRow(name, entity, float(values[column]), float(sigma[column]), unit)
        for column, (name, entity, unit) in enumerate(result.layout.border_names())
    ]


def sigma_of_images(result: AdjustmentResult) -> Floats:
    """(n, 6) of every projection centre, local axes, m, and small rotation in the camera frame, rad."""
    return _sigma(result, picture_cofactors(result.state, result.layout, result.cofactor, result.sigma0))


def sigma_of_points(result: AdjustmentResult) -> Floats:
    """(m, 3) of every object point, local axes, m; NaN for those that were not used."""
    return _sigma(result, with_considered(result.cofactor, result.sigma0).of_points)


def _sigma(result: AdjustmentResult, blocks: Floats) -> Floats:
    return np.asarray(result.sigma0 * np.sqrt(np.diagonal(blocks, axis1=1, axis2=2)))
