"""The influence of GNSS, INS, strip biases and control on system parameters, as a table.

Whoever applies a calibration to the flight it comes from needs it: the errors of the one are in the other.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.options import AdjustmentOptions
from adjust.parameters import GNSS_STRIP_BIAS
from adjust.quality.parameter_influences import ParameterInfluence, parameter_influences
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.quantities import reported_unit
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.parameters import PARAMETER_INFLUENCES

_KINDS = {
    GnssPositions.name: "position",
    InsAttitudes.name: "attitude",
    f"prior:{GNSS_STRIP_BIAS}": "strip_bias",
    ControlPoints.name: "control",
}
_DEGREE = float(np.rad2deg(1.0))


def write_parameter_influences(folder: Path, adjusted: AdjustedBlock, options: AdjustmentOptions) -> None:
    """parameter_influences.parquet; empty where GNSS and INS were not used or nothing was estimated.

    In a free network, too: its parameters hang on the approximate values.
    """
    names, factors, columns = _estimated(adjusted)
    observed = {group.group.name for group in adjusted.result.groups}
    rows = pd.DataFrame(columns=[column.name for column in PARAMETER_INFLUENCES.columns])
    if len(columns) and options.free_network is None and {GnssPositions.name, InsAttitudes.name} <= observed:
        found = parameter_influences(adjusted.result, columns)
        parts = [_rows(adjusted, item, names, factors) for item in found if item.group.name in _KINDS]
        rows = pd.concat(parts, ignore_index=True)
    write_stage_table(folder, PARAMETER_INFLUENCES, rows)


def _estimated(adjusted: AdjustedBlock) -> tuple[list[tuple[str, str, str]], Floats, np.ndarray]:
    """(parameter, entity, unit), factor from SI, and column of the border, of k parameters."""
    names, factors, columns = list[tuple[str, str, str]](), list[float](), list[int]()
    for parameters in adjusted.block.system:
        family = parameters.family
        if family.entity_kind == "strip":  # applied to no other flight, nor to this one
            continue
        for (entity, component), column in np.ndenumerate(adjusted.result.layout.columns[family.name]):
            if column >= 0:
                unit, factor = reported_unit(family, component)
                quantity = parameters.quantity(entity, component)
                names.append((quantity.name, quantity.entity, unit))
                factors.append(factor)
                columns.append(int(column))
    return names, np.array(factors), np.array(columns, dtype=np.int64)


def _rows(
    adjusted: AdjustedBlock, found: ParameterInfluence, names: list[tuple[str, str, str]], factors: Floats
) -> pd.DataFrame:
    """Rows of all parameters for the observations of one group."""
    group, kind = found.group, _KINDS[found.group.name]
    of_degree = _DEGREE if kind == "attitude" else 1.0
    derivative = found.derivative * factors[:, None, None] / of_degree
    sigma = np.where(group.stochastic.present, adjusted.sigma0 * group.stochastic.sigma, np.nan) * of_degree
    observation = _names(adjusted, found)
    count = len(observation)
    parameter, entity, unit = (
        np.repeat(np.array(part, dtype=object), count) for part in zip(*names, strict=True)
    )
    return pd.DataFrame(
        {
            "parameter": parameter,
            "entity": entity,
            "observation": kind,
            "name": np.tile(observation, len(names)),
            "unit": unit,
            **{f"by_{axis}": derivative[:, :, k].ravel() for k, axis in enumerate("xyz")},
            **{f"sigma_{axis}": np.tile(sigma[:, k], len(names)) for k, axis in enumerate("xyz")},
        }
    )


def _names(adjusted: AdjustedBlock, found: ParameterInfluence) -> np.ndarray:
    """(n,) events, points or strips of the observations."""
    group, block = found.group, adjusted.block
    if isinstance(group, ControlPoints):
        return np.array(block.points, dtype=object)[group.point]
    if isinstance(group, GnssPositions | InsAttitudes):
        return np.array(block.events, dtype=object)[group.event]
    strips = next(item.entities for item in block.system if item.family.name == GNSS_STRIP_BIAS)
    return np.array(strips, dtype=object)
