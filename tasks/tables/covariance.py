"""The covariance matrix of system parameters from parameters.parquet and correlations.parquet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.errors import InputError

#: Parameter and the camera, flight or strip it belongs to.
Key: TypeAlias = tuple[str, str]


def covariance_of(keys: Sequence[Key], parameters: pd.DataFrame, correlations: pd.DataFrame) -> Floats:
    """Covariance matrix (k, k) of estimated parameters in the units of the tables.

    Raises
    ------
    InputError
        If the correlation of two of them is missing.
    """
    names = list(zip(parameters["parameter"], parameters["entity"], strict=True))
    sigma_of = dict(zip(names, parameters["sigma"].astype(float), strict=True))
    sigma = np.array([sigma_of[key] for key in keys], dtype=np.float64)
    place = {key: number for number, key in enumerate(keys)}
    matrix = np.full((len(keys), len(keys)), np.nan)
    np.fill_diagonal(matrix, 1.0)
    columns = ("parameter_a", "entity_a", "parameter_b", "entity_b", "correlation")
    for one, of_one, other, of_other, value in zip(*(correlations[name] for name in columns), strict=True):
        i, j = place.get((one, of_one)), place.get((other, of_other))
        if i is not None and j is not None:
            matrix[i, j] = matrix[j, i] = float(value)
    missing = np.argwhere(np.isnan(matrix))
    if len(missing):
        one, other = (keys[int(k)] for k in missing[0])
        raise InputError(
            f"The calibration gives no correlation of {one[0]} of {one[1]} with {other[0]} of {other[1]}.",
            "Take parameters.parquet and correlations.parquet from the same run.",
        )
    return np.asarray(matrix * np.outer(sigma, sigma))
