"""System parameters and their correlations as tables, with what can be said about each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats
from adjust.observations.direct import DirectObservations
from adjust.parameters import FAMILIES, GNSS_SHIFT, INTERIOR_ORIENTATION
from adjust.result import AdjustmentResult
from tasks.block.result_tables import AdjustedBlock
from tasks.tables import schemas
from tasks.tables.parquet import write_table

# A parameter whose standard deviation is still this part of its prior has learnt nothing from the block.
_PRIOR_ONLY = 0.975
# 1 − R² with all other free system parameters below which nothing of a parameter is its own: the
# standard deviation is a hundred times what it would be if the others were known.
_INSEPARABLE = 1e-4


def parameter_table(adjusted: AdjustedBlock, confidence: float) -> pd.DataFrame:
    """All parameters of the cameras in use, and those of the flights if they are free.

    ``t`` is the change over its standard deviation, tested two-sided at ``confidence``.
    """
    result, layout = adjusted.result, adjusted.result.layout
    limit = float(special.stdtrit(max(result.test.redundancy, 1), 0.5 + 0.5 * confidence))
    cofactor = np.diagonal(result.cofactor.reduced.corner)
    own_part = 1.0 - total_correlation(result) ** 2
    priors = _prior_sigmas(result)
    rows = []
    for parameters in adjusted.block.system:
        family = parameters.family
        if family.name == GNSS_SHIFT and not parameters.free.any():
            continue
        unit, factor = reported_unit(family.name)
        columns = layout.columns[family.name]
        adjusted_values = result.state.system[family.name]
        for (entity, component), column in np.ndenumerate(columns):
            given = float(parameters.values[entity, component])
            value = float(adjusted_values[entity, component])
            row: dict[str, object] = {
                "parameter": family.components[component],
                "entity": parameters.entities[entity],
                "value": value * factor,
                "change": (value - given) * factor,
                "unit": unit,
                "sigma": np.nan,
                "sigma_prior": np.nan,
                "t": np.nan,
                "status": "fixed",
            }
            if column >= 0:
                sigma = adjusted.sigma0 * float(np.sqrt(cofactor[column]))
                prior = priors.get((family.name, entity, component), np.nan)
                t = (value - given) / sigma
                row |= {"sigma": sigma * factor, "sigma_prior": prior * factor, "t": t}
                row["status"] = _status(sigma, prior * adjusted.sigma0, float(own_part[column]), t, limit)
            rows.append(row)
    return pd.DataFrame(rows)


def _status(sigma: float, prior: float, own_part: float, t: float, limit: float) -> str:
    if own_part < _INSEPARABLE:
        return "not_determinable"
    if np.isfinite(prior) and sigma > _PRIOR_ONLY * prior:
        return "prior_only"
    return "significant" if abs(t) > limit else "not_significant"


def _prior_sigmas(result: AdjustmentResult) -> dict[tuple[str, int, int], float]:
    """A-priori standard deviations of directly observed parameters, SI and radians."""
    priors = {}
    for group in result.groups:
        if isinstance(group.group, DirectObservations):
            for row, entity in enumerate(group.group.entity):
                for component, sigma in enumerate(group.sigma[row]):
                    priors[group.group.family, int(entity), component] = float(sigma)
    return priors


def reported_unit(family: str) -> tuple[str, float]:
    """Unit of a family in the tables and the factor from SI and radians."""
    if family == INTERIOR_ORIENTATION:
        return "mm", 1e3
    unit = FAMILIES[family].unit
    return ("deg", float(np.rad2deg(1.0))) if unit == "rad" else (unit, 1.0)


def correlation_matrix(result: AdjustmentResult) -> Floats:
    """Correlations (g, g) of the free system parameters."""
    corner = result.cofactor.reduced.corner
    scale = 1.0 / np.sqrt(np.diagonal(corner))
    return np.asarray(corner * scale[:, None] * scale[None, :])


def total_correlation(result: AdjustmentResult) -> Floats:
    """Correlation R (g,) of each free system parameter with all others together, 0 to 1.

    R² = 1 − 1/(q_ii p_ii) with the cofactor matrix Q of the system parameters and P = Q⁻¹.
    """
    if result.layout.border == 0:
        return np.zeros(0)
    # Of the correlation matrix: its diagonal is one, and units do not spoil the inverse.
    inverse = np.linalg.inv(correlation_matrix(result))
    return np.asarray(np.sqrt(np.clip(1.0 - 1.0 / np.diagonal(inverse), 0.0, 1.0)))


def write_parameters(folder: Path, adjusted: AdjustedBlock, confidence: float) -> pd.DataFrame:
    """parameters.parquet and correlations.parquet; returns the parameters."""
    table = parameter_table(adjusted, confidence)
    write_table(
        folder / "parameters.parquet",
        schemas.PARAMETERS,
        {name: table[name].to_numpy() for name in table.columns},
    )
    names = adjusted.result.layout.border_names()
    first, second = np.triu_indices(len(names), 1)
    write_table(
        folder / "correlations.parquet",
        schemas.CORRELATIONS,
        {
            "parameter_a": [names[i][0] for i in first],
            "entity_a": [names[i][1] for i in first],
            "parameter_b": [names[i][0] for i in second],
            "entity_b": [names[i][1] for i in second],
            "correlation": correlation_matrix(adjusted.result)[first, second],
        },
    )
    return table
