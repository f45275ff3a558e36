"""Differences of adjusted and observed orientations, their robust means and nested tests.

Formulas: docs/theory/two-step.md; Huber (1964, 1981); Weerahandi (1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import scipy.linalg
from scipy import optimize, special, stats

from tests.golden.delivered_block import STEP, Array, mounting, opk, rpy, small_log, turned

BODY = ("roll", "pitch", "yaw")
COMPONENTS = (*BODY, "forward", "right", "down", "east", "north", "up")
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
LIMIT = 1.5


@dataclass(frozen=True)
class Huber:
    """M-estimate of location: value, factors, and its influence function, of n values."""

    value: float
    weight: Array
    influence: Array

    def sigma(self, cluster: Array) -> float:
        """√(k/(k − 1) Σ (Σ influences)²) over clusters; over single values where there is only one."""
        if len(set(cluster)) == 1:
            cluster = np.arange(len(self.influence))
        sums = pd.Series(self.influence).groupby(np.asarray(cluster)).sum().to_numpy()
        return float(np.sqrt(len(sums) / (len(sums) - 1) * (sums @ sums)))


def huber(values: Array) -> Huber:
    """With the scale 1.4826 median |v|, about the median."""
    scale = np.median(np.abs(values - np.median(values))) / stats.norm.ppf(0.75)

    def psi(at: float) -> Array:
        return np.clip(values - at, -LIMIT * scale, LIMIT * scale)

    found = optimize.brentq(lambda at: psi(at).sum(), values.min(), values.max(), xtol=1e-18, rtol=1e-15)
    v = np.abs(values - found)
    inside = v <= LIMIT * scale
    return Huber(found, LIMIT * scale / np.maximum(v, LIMIT * scale), psi(found) / inside.sum())


def sigma_of_mean(strips: Array, known: Array, count: Array) -> tuple[float, float, float]:
    """σ, ν and known part: quantiles of the mixture over χ² of normal distributions."""
    k, share, across = len(strips), count / count.sum(), scipy.linalg.helmert(len(strips))
    spread, axes = np.linalg.eigh(across @ known @ across.T)
    c2 = (axes.T @ across @ strips) ** 2
    chi = np.geomspace(1e-11, 1e3, 4001) * (k - 1)
    mass = stats.chi2.pdf(chi, k - 1) * chi
    low, high = np.zeros(len(chi)), c2.sum() / chi
    for _ in range(60):
        middle = 0.5 * (low + high)
        more = (c2 / (middle[:, None] + spread)).sum(axis=1) > chi
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    of_known = share @ known @ share
    sigma = np.sqrt(high * (share @ share) + of_known)

    def quantile(level: float) -> float:
        def excess(q: float) -> float:
            return float(mass @ special.ndtr(q / sigma) / mass.sum()) - level

        return float(optimize.brentq(excess, 0.0, 50.0 * np.median(sigma), xtol=1e-16, rtol=1e-12))

    inner, outer = quantile(special.ndtr(1.0)), quantile(0.975)

    def ratio(nu: float) -> float:
        return float(special.stdtrit(nu, 0.975) / special.stdtrit(nu, special.ndtr(1.0)))

    most = 1e6
    if ratio(most) < outer / inner:
        most = float(optimize.brentq(lambda nu: ratio(nu) - outer / inner, 0.5, most))
    return inner / float(special.stdtrit(most, special.ndtr(1.0))), most, float(np.sqrt(of_known))


def angles_of_rotation(vector: Array) -> Array:
    """Roll, pitch, yaw of R_z R_y R_x = Exp(vector)."""
    x, y, z = vector
    r = scipy.linalg.expm(np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    return np.array([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])])


@dataclass(frozen=True, eq=False)
class Strips:
    """Exposures of one camera in a map without a projection, adjusted and observed.

    Attributes
    ----------
    given : as delivered.
    centre, angles : (n, 3) adjusted, m and ω, φ, κ in rad.
    covariance : (6 n, 6 n) of both, exposure after exposure; None: not known.
    """

    given: pd.DataFrame
    centre: Array
    angles: Array
    covariance: Array | None = None

    def differences(self, exposure: Array) -> Array:
        """(n, 9) at orientations (n, 6)."""
        body = ENU_FROM_NED @ rpy(np.radians(self.given[["roll", "pitch", "heading"]].to_numpy()))
        offset = self.given[["x", "y", "z"]].to_numpy() - exposure[:, :3]
        from_local = np.swapaxes(body, 1, 2)
        misalignment = small_log(from_local @ opk(exposure[:, 3:]) @ mounting(0).T)
        return np.hstack([misalignment, turned(from_local, offset), offset])

    @cached_property
    def values(self) -> Array:
        return self.differences(np.hstack([self.centre, self.angles]))

    @cached_property
    def names(self) -> list[str]:
        return sorted(set(self.given["strip"]))

    @cached_property
    def of_strip(self) -> Array:
        """(n,) number of the strip of each exposure."""
        return self.given["strip"].map({name: k for k, name in enumerate(self.names)}).to_numpy()

    @cached_property
    def heading(self) -> Array:
        """(s,) mean directions of the strips, rad."""
        turns = np.exp(1j * np.radians(self.given["heading"].to_numpy()))
        return np.array([np.angle(turns[self.of_strip == k].mean()) for k in range(len(self.names))])

    @cached_property
    def robust(self) -> list[list[Huber]]:
        """Of each strip, nine components."""
        rows = [self.values[self.of_strip == k] for k in range(len(self.names))]
        return [[huber(own[:, c]) for c in range(9)] for own in rows]

    @cached_property
    def mean(self) -> Array:
        return np.array([[one.value for one in of_strip] for of_strip in self.robust])

    @cached_property
    def known(self) -> Array | None:
        """(9, s, 9, s) of the means of strips; axes of the body as at the mean heading of each."""
        if self.covariance is None:
            return None
        n, s = len(self.given), len(self.names)
        functional = np.zeros((9, s, n, 6))
        for k in range(6):
            exposure = np.hstack([self.centre, self.angles]).astype(complex)
            exposure[:, k] += 1j * STEP
            change = self.differences(exposure).imag / STEP
            for strip in range(s):
                own = np.flatnonzero(self.of_strip == strip)
                functional[:, strip, own, k] = change[own].T / len(own)
        sine, cosine = np.sin(self.heading)[:, None, None], np.cos(self.heading)[:, None, None]
        east, north = functional[6].copy(), functional[7].copy()
        functional[3], functional[4] = sine * east + cosine * north, cosine * east - sine * north
        functional[5] = -functional[8]
        f = functional.reshape(9 * s, 6 * n)
        return np.asarray(f @ self.covariance @ f.T).reshape(9, s, 9, s)

    def body_fixed(self, strips: Array) -> Array:
        """(2 k, 2) A lever arm forward, right in east and north of strips."""
        sine, cosine = np.sin(self.heading[strips]), np.cos(self.heading[strips])
        return np.stack([[sine, cosine], [cosine, -sine]]).transpose(2, 0, 1).reshape(-1, 2)


def explained(design: Array) -> Array:
    """(n, n) Projector onto what a design explains; directions below 2 % of the strongest are nothing."""
    if design.shape[1] == 0:
        return np.zeros((len(design), len(design)))
    scaled = design / np.sqrt((design**2).sum(axis=0))
    return np.asarray(scaled @ np.linalg.pinv(scaled, rcond=0.02))


def nested(smaller: Array, larger: Array, y: Array, known: Array | None) -> tuple[float, int, int, float]:
    """χ², q, f and probability of the F-test; the variance is larger by what known errors hide from it."""
    small, large = explained(smaller), explained(larger)
    rest, more = np.eye(len(y)) - large, large - small
    q, f = round(np.trace(more)), round(np.trace(rest))
    if q == 0 or f == 0:
        return np.nan, q, f, np.nan
    variance = y @ rest @ y / f
    if known is not None:
        variance += max(np.trace(more @ known) / q - np.trace(rest @ known) / f, 0.0)
    chi2 = float(y @ more @ y / variance)
    return chi2, q, f, float(stats.f.sf(chi2 / q, q, f))
