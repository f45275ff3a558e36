"""The covariance matrix of system parameters from parameters.parquet and correlations.parquet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeAlias

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.errors import InputError

#: Parameter and the camera, flight or strip it belongs to.
Key: TypeAlias = tuple[str, str]


def correlation_pairs(correlations: pd.DataFrame) -> Mapping[tuple[Key, Key], float]:
    """The correlations of correlations.parquet, each pair once."""
    pairs = zip(
        zip(correlations["parameter_a"], correlations["entity_a"], strict=True),
        zip(correlations["parameter_b"], correlations["entity_b"], strict=True),
        strict=True,
    )
    return dict(zip(pairs, correlations["correlation"].astype(float), strict=True))


def correlation_table(keys: list[Key], correlation: Floats) -> pd.DataFrame:
    """correlations.parquet of parameters with a correlation matrix (k, k): every pair once."""
    first, second = np.triu_indices(len(keys), 1)
    return pd.DataFrame(
        {
            "parameter_a": [keys[i][0] for i in first],
            "entity_a": [keys[i][1] for i in first],
            "parameter_b": [keys[i][0] for i in second],
            "entity_b": [keys[i][1] for i in second],
            "correlation": correlation[first, second],
        }
    )


def sigmas_of(parameters: pd.DataFrame) -> Mapping[Key, float]:
    """Standard deviations of the estimated parameters of parameters.parquet, in their units."""
    own = parameters[parameters["sigma"].notna()]
    return dict(
        zip(zip(own["parameter"], own["entity"], strict=True), own["sigma"].astype(float), strict=True)
    )


def covariance_of(
    keys: Iterable[Key], sigmas: Mapping[Key, float], correlations: Mapping[tuple[Key, Key], float]
) -> Floats:
    """Covariance matrix (k, k) of estimated parameters in products of the units of their σ.

    Raises
    ------
    InputError
        If the correlation of two of them is missing.
    """
    chosen = list(keys)
    result = np.diag([sigmas[key] ** 2 for key in chosen])
    for i, one in enumerate(chosen):
        for j, other in enumerate(chosen[:i]):
            correlation = correlations.get((one, other), correlations.get((other, one)))
            if correlation is None:
                raise InputError(
                    f"The calibration gives no correlation of {one[0]} of {one[1]} with {other[0]} of "
                    f"{other[1]}.",
                    "Take parameters.parquet and correlations.parquet from the same run.",
                )
            result[i, j] = result[j, i] = correlation * sigmas[one] * sigmas[other]
    return np.asarray(result.reshape(len(chosen), len(chosen)))
