"""Covariances before the flight in the tables of an adjustment: parameters and correlations."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.planning.a_priori import APriori
from adjust.selection.determinability import INSEPARABLE, PRIOR_ONLY
from tasks.quantities import reported


def expected_parameters(expected: APriori) -> pd.DataFrame:
    """The free parameters with the columns of parameters.parquet; nothing is estimated, so no change."""
    own_part = expected.own_part
    rows = []
    for k, (parameter, entity, own_unit) in enumerate(expected.names):
        unit, factor = reported(parameter, own_unit)
        sigma, prior = float(expected.sigma[k]), float(expected.prior_sigma[k])
        status = "not_significant"
        if own_part[k] < INSEPARABLE:
            status = "not_determinable"
        elif np.isfinite(prior) and sigma > PRIOR_ONLY * prior:
            status = "prior_only"
        rows.append(
            {
                "parameter": parameter,
                "entity": entity,
                "value": float(expected.value[k]) * factor,
                "change": 0.0,
                "sigma": sigma * factor,
                "sigma_prior": prior * factor,
                "sigma_over_prior": sigma / prior,
                "unit": unit,
                "t": 0.0,
                "status": status,
            }
        )
    return pd.DataFrame(rows)


def expected_correlations(expected: APriori) -> pd.DataFrame:
    """Every pair once, with the columns of correlations.parquet."""
    names, correlation = expected.names, expected.correlation
    first, second = np.triu_indices(len(names), 1)
    return pd.DataFrame(
        {
            "parameter_a": [names[i][0] for i in first],
            "entity_a": [names[i][1] for i in first],
            "parameter_b": [names[i][0] for i in second],
            "entity_b": [names[i][1] for i in second],
            "correlation": correlation[first, second],
        }
    )
