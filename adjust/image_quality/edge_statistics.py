"""Combined result of many edges: the mean factor with its σ, the profile and the response of all.

Edges of a scene can be softer than the camera (shadows, worn paint), never sharper. Values that lie outside
the others by more than 3.5 robust standard deviations are left out of the mean, and counted. The σ of the
mean is that of the scatter of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.image_quality.edge_measurement import MeasuredEdge
from adjust.image_quality.edge_profile import EdgeProfile, edge_profile, normalized
from adjust.image_quality.iso_12233 import FrequencyResponse, frequency_response

_OUTSIDE = 3.5
_MAD = 1.4826
#: Edges that a mean should have at least.
ENOUGH = 20


@dataclass(frozen=True, eq=False)
class EdgeStatistics:
    """Edges of one kind.

    Attributes
    ----------
    edges : number used.
    left_out : number that lie outside the others.
    factor, sigma_factor : mean factor of effective resolution, and its standard deviation (NaN of one edge).
    scatter : standard deviation of a factor.
    stated : root mean square of the standard deviations that the adjustments state.
    blur : mean σ of the blur, px.
    profile : through all pixels.
    response : of all pixels.
    method : whether the factor is of the model, or of the profile of sharpened edges.
    """

    edges: int
    left_out: int
    factor: float
    sigma_factor: float
    scatter: float
    stated: float
    blur: float
    profile: EdgeProfile
    response: FrequencyResponse
    method: str


def edge_statistics(measured: Sequence[MeasuredEdge]) -> EdgeStatistics:
    """Edges (at least one) together."""
    factors = np.array([one.fit.factor for one in measured])
    used = _inside(factors)
    fits = [one.fit for one, is_used in zip(measured, used, strict=True) if is_used]
    pixels = normalized(fits)
    profile = edge_profile(pixels)
    scatter = float(np.std(factors[used], ddof=1)) if len(fits) > 1 else float("nan")
    mean, sigma = float(np.mean(factors[used])), scatter / np.sqrt(len(fits))
    if profile.sharpened:
        mean, sigma = profile.width()
    return EdgeStatistics(
        edges=len(fits),
        left_out=int(np.count_nonzero(~used)),
        factor=mean,
        sigma_factor=float(sigma),
        scatter=scatter,
        stated=float(np.sqrt(np.mean([fit.sigma_factor**2 for fit in fits]))),
        blur=float(np.mean([fit.blur for fit in fits])),
        profile=profile,
        response=frequency_response(pixels),
        method="profile" if profile.sharpened else "model",
    )


def _inside(values: Floats) -> Bools:
    """Values (n,) that are not far from the median."""
    away = np.abs(values - np.median(values))
    # A few edges that agree by chance would make everything else an outlier.
    robust = max(_MAD * float(np.median(away)), 0.01)
    return np.asarray(away <= _OUTSIDE * robust)
