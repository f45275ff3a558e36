"""What is held in a calibration, and how well it is known: considered in every certified σ.

A lever arm, the times of the exposures, refraction and the datum of the control are held at values that are
not perfectly known. With the effect e = −Q AᵀC of each on the calibrated parameters,

    Σ = σ0² Q + Σ_b σ_b² e_b e_bᵀ,    σ_b: standard deviation of the held quantity b,

is the covariance of what is certified (consider covariance: Bierman 1977, ch. VIII). The effects are those of
the tests of the model; estimated quantities have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.calibration.record import RecordedHeld
from tasks.settings.calibration import HeldSigmas
from tasks.tables.covariance import Key, correlation_pairs, correlation_table, covariance_of, sigmas_of

_AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class WithHeld:
    """Parameters and correlations whose σ contain what was held.

    Attributes
    ----------
    parameters, correlations : as parameters.parquet and correlations.parquet.
    held : what was held.
    """

    parameters: pd.DataFrame
    correlations: pd.DataFrame
    held: tuple[RecordedHeld, ...]


def with_held(
    parameters: pd.DataFrame,
    correlations: pd.DataFrame,
    effects: pd.DataFrame,
    sigmas: dict[str, float],
    limit_of_t: float,
) -> WithHeld:
    """Add what is held to the standard deviations and correlations of the parameters.

    Parameters
    ----------
    effects : model_alternative_effects.parquet.
    sigmas : quantity → standard deviation, see `held_sigmas`.
    limit_of_t : |t| beyond which a change is significant; with larger σ fewer are.
    """
    estimated = parameters[parameters["sigma"].notna()]
    keys: list[Key] = list(zip(estimated["parameter"], estimated["entity"], strict=True))
    covariance = covariance_of(keys, sigmas_of(parameters), correlation_pairs(correlations))
    chosen = effects[(effects["scope"] == "all") & effects["quantity"].isin(sigmas)]
    shares: dict[tuple[str, str, str], Floats] = {}
    for key, own in chosen.groupby(["quantity", "entity", "unit"], sort=True):
        quantity, entity, unit = (str(name) for name in cast("tuple[str, str, str]", key))
        by_key = dict(
            zip(zip(own["parameter"], own["parameter_entity"], strict=True), own["effect"], strict=True)
        )
        share = sigmas[quantity] * np.array([by_key.get(key, 0.0) for key in keys])
        covariance += np.outer(share, share)
        shares[quantity, entity, unit] = share
    spread = np.sqrt(np.diagonal(covariance))
    return WithHeld(
        _with_sigmas(parameters, keys, spread, limit_of_t),
        correlation_table(keys, covariance / np.outer(spread, spread)),
        tuple(
            RecordedHeld(
                quantity=quantity,
                entity=entity,
                unit=unit,
                sigma=sigmas[quantity],
                moves=keys[most][0],
                moves_entity=keys[most][1],
                part=float(np.abs(share[most]) / spread[most]),
            )
            for (quantity, entity, unit), share in shares.items()
            for most in (int(np.argmax(np.abs(share) / spread)),)
        ),
    )


def _with_sigmas(
    parameters: pd.DataFrame, keys: list[Key], spread: Floats, limit_of_t: float
) -> pd.DataFrame:
    sigma = dict(zip(keys, spread, strict=True))
    table = parameters.copy()
    rows = list(zip(table["parameter"], table["entity"], strict=True))
    table["sigma"] = [sigma.get(key, np.nan) for key in rows]
    table["t"] = table["change"] / table["sigma"]
    no_longer = (table["status"] == "significant") & (table["t"].abs() <= limit_of_t)
    table["status"] = table["status"].mask(no_longer, "not_significant")
    return table


def held_sigmas(stated: HeldSigmas, residuals: pd.DataFrame) -> dict[str, float]:
    """Standard deviation of every quantity that may be held.

    Parameters
    ----------
    residuals : residuals.parquet; the datum of the control is as well known as its points, if nothing else is
        stated.
    """
    found = {f"lever_arm_{axis}": stated.lever_arm_m for axis in _AXES}
    found |= {"time_offset": stated.time_offset_s, "refraction": stated.refraction}
    control = residuals[residuals["group"] == "control_points"]
    for k, axis in enumerate(_AXES):
        own = control.loc[control["component"] == axis, "sigma"]
        if stated.control_m is not None:
            found[f"control_shift_{axis}"] = stated.control_m[k]
        elif len(own):
            found[f"control_shift_{axis}"] = float(own.median())
    return found
