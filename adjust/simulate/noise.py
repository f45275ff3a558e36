"""Noise of the measurements, each source from its own stream."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.gauss_markov import GaussMarkov
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
    ins : of roll, pitch, yaw, white.
    gnss_markov, ins_markov : of the parts of their noise that are correlated over time, exp(−|Δt|/τ) within a
        strip.
    gnss_correlation_time, ins_correlation_time : τ, seconds.
    level : factor of all noise; 0: free of noise.
    silent : sources whose noise is left out.
    """

    image: float
    control: Triple
    gnss: Triple
    ins: Triple
    gnss_markov: Triple = (0.0, 0.0, 0.0)
    gnss_correlation_time: float = 100.0
    ins_markov: Triple = (0.0, 0.0, 0.0)
    ins_correlation_time: float = 100.0
    level: float = 1.0
    silent: frozenset[Source] = frozenset()

    @property
    def stated_gnss(self) -> Floats:
        """Standard deviations (3,) of a single position as a delivery would state them."""
        return np.hypot(self.gnss, self.gnss_markov)

    @property
    def stated_ins(self) -> Floats:
        """Standard deviations (3,) of a single attitude likewise, radians."""
        return np.hypot(self.ins, self.ins_markov)


def white_noise(
    specification: NoiseSpecification, streams: RandomStreams, source: Source, sigma: Floats, rows: int
) -> Floats:
    """Independent normal numbers (rows, k) with standard deviations sigma (k,)."""
    return streams.of(source).standard_normal((rows, len(sigma))) * sigma * _level(specification, source)


def gnss_markov_noise(
    specification: NoiseSpecification, streams: RandomStreams, time: Floats, strip: Ints
) -> Floats:
    """First-order Gauss–Markov noise (n, 3) of positions, metres, at times (n,) in strips (n,)."""
    sigma = np.array(specification.gnss_markov) * _level(specification, Source.GNSS_MARKOV)
    time_constant = specification.gnss_correlation_time
    return _markov_noise(streams.of(Source.GNSS_MARKOV), sigma, time_constant, time, strip)


def ins_markov_noise(
    specification: NoiseSpecification, streams: RandomStreams, time: Floats, strip: Ints
) -> Floats:
    """The same of attitudes: small rotations (n, 3) in body axes, radians."""
    sigma = np.array(specification.ins_markov) * _level(specification, Source.INS_MARKOV)
    time_constant = specification.ins_correlation_time
    return _markov_noise(streams.of(Source.INS_MARKOV), sigma, time_constant, time, strip)


def _markov_noise(
    random: np.random.Generator, sigma: Floats, correlation_time: float, time: Floats, strip: Ints
) -> Floats:
    """e_i = φ e_(i−1) + √(1 − φ²) σ w, φ = exp(−Δt/τ), (n, 3); strips are independent of each other."""
    if not sigma.any():
        return np.zeros((len(time), 3))
    white = random.standard_normal((len(time), 3))
    process = GaussMarkov(strip, time, correlation_time)
    return np.asarray(process.neighbours(np.ones(len(time), dtype=bool)).correlated(white) * sigma)


def _level(specification: NoiseSpecification, source: Source) -> float:
    return 0.0 if source in specification.silent else specification.level
