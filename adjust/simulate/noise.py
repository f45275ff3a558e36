"""Noise of the measurements, each source from its own stream."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.simulate.random_streams import RandomStreams, Source

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class NoiseSpecification:
    """Standard deviations of the measurements; metres and radians.

    They are also what the observations claim; ``level`` scales what is really added.

    Attributes
    ----------
    image : of image coordinates.
    control : of surveyed points along east, north, up.
    gnss : of positions, white, along east, north, up.
    gnss_markov : of the part of their noise that is correlated over time, exp(−|Δt|/τ) within a strip.
    gnss_correlation_time : τ, seconds.
    ins : roll, pitch, yaw.
    level : factor of all noise; 0: free of noise.
    silent : sources whose noise is left out.
    """

    image: float
    control: Triple
    gnss: Triple
    ins: Triple
    gnss_markov: Triple = (0.0, 0.0, 0.0)
    gnss_correlation_time: float = 100.0
    level: float = 1.0
    silent: frozenset[Source] = frozenset()

    @property
    def stated_gnss(self) -> Floats:
        """Standard deviations (3,) of a single position as a delivery would state them."""
        return np.hypot(self.gnss, self.gnss_markov)


def white_noise(
    specification: NoiseSpecification, streams: RandomStreams, source: Source, sigma: Floats, rows: int
) -> Floats:
    """Independent normal numbers (rows, k) with standard deviations sigma (k,)."""
    return streams.of(source).standard_normal((rows, len(sigma))) * sigma * _level(specification, source)


def markov_noise(
    specification: NoiseSpecification, streams: RandomStreams, time: Floats, strip: Ints
) -> Floats:
    """First-order Gauss–Markov noise (n, 3), metres, for exposures at times (n,) in strips (n,).

    e_i = f e_(i−1) + √(1 − f²) σ w,  f = exp(−Δt/τ); strips are independent of each other.
    """
    source = Source.GNSS_MARKOV
    white = streams.of(source).standard_normal((len(time), 3))
    result = np.empty_like(white)
    order = np.lexsort((time, strip))
    for number, i in enumerate(order):
        before = order[number - 1]
        if number == 0 or strip[before] != strip[i]:
            result[i] = white[i]
            continue
        factor = np.exp(-(time[i] - time[before]) / specification.gnss_correlation_time)
        result[i] = factor * result[before] + np.sqrt(1.0 - factor**2) * white[i]
    return np.asarray(result * specification.gnss_markov * _level(specification, source))


def _level(specification: NoiseSpecification, source: Source) -> float:
    return 0.0 if source in specification.silent else specification.level
