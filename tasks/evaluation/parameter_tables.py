"""System parameters and their correlations as tables, with the findings for each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats
from adjust.observations.direct import DirectObservations
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import GNSS_SHIFT, ParameterPlace, Quantity
from adjust.result import AdjustmentResult
from adjust.selection.correlation import correlation_matrix, total_correlation
from adjust.selection.determinability import INSEPARABLE, PRIOR_ONLY
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.quantities import reported_unit
from tasks.tables.covariance import correlation_table
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.parameters import CORRELATIONS, PARAMETERS


def parameter_table(
    adjusted: AdjustedBlock, confidence: float, eliminated: frozenset[tuple[str, str]] = frozenset()
) -> pd.DataFrame:
    """All parameters of the cameras in use, and those of the flights if they are free.

    ``t`` is the change over its standard deviation, tested two-sided at ``confidence``.

    Parameters
    ----------
    eliminated : (parameter, entity) of those that were offered and taken out.
    """
    result, layout = adjusted.result, adjusted.result.layout
    limit = float(special.stdtrit(max(result.test.redundancy, 1), 0.5 + 0.5 * confidence))
    cofactor = np.diagonal(adjusted.cofactor.reduced.corner)
    own_part = 1.0 - total_correlation(result.cofactor.reduced.corner) ** 2
    considered = _considered_sigmas(adjusted)
    priors = _prior_sigmas(result)
    rows = []
    for parameters in adjusted.block.system:
        family = parameters.family
        if family.name == GNSS_SHIFT and not parameters.free.any():
            continue
        columns = layout.columns[family.name]
        adjusted_values = result.state.system[family.name]
        for (entity, component), column in np.ndenumerate(columns):
            given = float(parameters.values[entity, component])
            value = float(adjusted_values[entity, component])
            unit, factor = reported_unit(family, component)
            quantity = parameters.quantity(entity, component)
            row: dict[str, object] = {
                **columns_of(quantity),
                "value": value * factor,
                "change": (value - given) * factor,
                "unit": unit,
                "sigma": np.nan,
                "sigma_prior": np.nan,
                "sigma_over_prior": np.nan,
                "t": np.nan,
                "status": "fixed",
            }
            if column >= 0:
                sigma = adjusted.sigma0 * float(np.sqrt(cofactor[column]))
                prior = priors.get((family.name, entity, component), np.nan)
                # The prior is used with its stated weight, whatever σ0 turns out to be.
                ratio = float(np.sqrt(cofactor[column])) / prior
                t = (value - given) / sigma
                row |= {"sigma": sigma * factor, "sigma_prior": prior * factor, "t": t}
                row |= {
                    "sigma_over_prior": ratio,
                    "status": _status(ratio, float(own_part[column]), t, limit),
                }
            elif ParameterPlace(family.name, entity, component) in considered:
                known = considered[ParameterPlace(family.name, entity, component)]
                row |= {"sigma": known * factor, "status": "considered"}
            elif (quantity.name, quantity.entity) in eliminated:
                row["status"] = "eliminated"
            rows.append(row)
    return pd.DataFrame(rows)


def _status(sigma_over_prior: float, own_part: float, t: float, limit: float) -> str:
    if own_part < INSEPARABLE:
        return "not_determinable"
    if sigma_over_prior > PRIOR_ONLY:
        return "prior_only"
    return "significant" if abs(t) > limit else "not_significant"


def _prior_sigmas(result: AdjustmentResult) -> dict[tuple[str, int, int], float]:
    """A-priori standard deviations of directly observed parameters, SI and radians."""
    priors = {}
    for group in result.groups:
        if isinstance(group.group, DirectObservations):
            for row, entity in enumerate(group.group.entity):
                for component, sigma in enumerate(group.sigma[row]):
                    priors[group.group.family.name, int(entity), component] = float(sigma)
        if isinstance(group.group, JointPrior):
            for place, sigma in zip(group.group.places, group.sigma[0], strict=True):
                priors[place.family, place.entity, place.component] = float(sigma)
    return priors


def _considered_sigmas(adjusted: AdjustedBlock) -> dict[ParameterPlace, float]:
    """Standard deviations of considered parameters as they were given, SI and radians."""
    known = adjusted.block.considered
    if known is None:
        return {}
    return dict(zip(known.places, np.sqrt(np.diagonal(known.covariance)).tolist(), strict=True))


def columns_of(quantity: Quantity) -> dict[str, str | None]:
    """Name and owner of a parameter, for a row of a table."""
    return {
        "parameter": quantity.name,
        "entity": quantity.entity,
        "camera": quantity.camera,
        "flight": quantity.flight,
        "strip": quantity.strip,
    }


def _correlated(adjusted: AdjustedBlock) -> tuple[list[Quantity], Floats]:
    """The free and the considered parameters, and their correlations.

    An estimate follows the errors of what is considered, so both are correlated: Cov(x, g) = −K C.
    """
    names = list(adjusted.result.layout.border_quantities)
    corner, errors = adjusted.cofactor.reduced.corner, adjusted.result.cofactor.considered
    if errors is None:
        return names, correlation_matrix(corner)
    system = {item.family.name: item for item in adjusted.block.system}
    for family, entity, component in errors.known.places:
        names.append(system[family].quantity(entity, component))
    mixed = errors.of_unknowns.of_border @ errors.known.root.T
    covariance = np.block([[adjusted.sigma0**2 * corner, mixed], [mixed.T, errors.known.covariance]])
    return names, correlation_matrix(covariance)


def write_parameters(
    folder: Path,
    adjusted: AdjustedBlock,
    confidence: float,
    eliminated: frozenset[tuple[str, str]] = frozenset(),
) -> pd.DataFrame:
    """parameters.parquet and correlations.parquet; returns the parameters."""
    table = parameter_table(adjusted, confidence, eliminated)
    write_stage_table(folder, PARAMETERS, table)
    names, correlations = _correlated(adjusted)
    keys = [(item.name, item.entity) for item in names]
    write_stage_table(folder, CORRELATIONS, correlation_table(keys, correlations))
    return table
