"""The restricted likelihood of the weights: dΣ/dθ of all variance components and correlation times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tests.golden.delivered_block import STEP, Array, part_of
from tests.golden.oracle import Oracle


@dataclass(frozen=True)
class Timing:
    """Of the strips: median interval of exposures, longest duration, s; mean number of exposures."""

    interval: float
    longest: float
    exposures: float

    def zeta(self, seconds: float) -> float:
        """artanh φ of the interval."""
        return float(np.arctanh(np.exp(-self.interval / seconds)))


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Derivatives of Σ by log σ² of the parts and by ζ of the correlation times that were estimated."""

    oracle: Oracle

    @cached_property
    def times(self) -> Mapping[str, Mapping[str, Any]]:
        """Figures of correlation times, by group."""
        return {item["group"]: item for item in self.oracle.results.summary["correlation_times"] or ()}

    @cached_property
    def components(self) -> Mapping[str, Mapping[str, Any]]:
        """Figures of variance components that were estimated, by part."""
        figures = self.oracle.results.summary["variance_components"]
        return {
            item["part"]: item for item in (figures or {"components": ()})["components"] if item["estimated"]
        }

    @cached_property
    def estimated(self) -> list[str]:
        return [*self.components, *(name for name, item in self.times.items() if item["tested"])]

    @cached_property
    def timing(self) -> Timing:
        block = self.oracle.block
        times = [np.sort(block.time[np.array(block.strip) == strip]) for strip in sorted(set(block.strip))]
        steps = np.concatenate([np.diff(t) for t in times])
        exposures = 1.0 + len(steps) / len(times)
        return Timing(float(np.median(steps)), max(float(np.ptp(t)) for t in times), exposures)

    def derivative(self, name: str) -> Array:
        """Of one of them, over the scalars used."""
        d = self.oracle.dense
        if name in self.components:
            own = np.array([part_of(key) == name for key in self.oracle.keys], dtype=float)
            return np.asarray(0.5 * (own[:, None] + own) * d.covariance)
        block, tau = self.oracle.block, float(self.times[name]["correlation_s"])
        by_tau = block.over_time(name, block.series[name], 1j * STEP).imag / STEP
        rows = [k for k, key in enumerate(d.keys) if key[0] == name]
        whole = np.zeros((len(d.keys), len(d.keys)))
        stated = np.sqrt(np.diagonal(block.over_time(name, block.series[name])))
        factor = d.sigma[rows] / stated
        whole[np.ix_(rows, rows)] = by_tau * np.outer(factor, factor)
        # φ = exp(−Δ/τ) = tanh ζ.
        phi = np.exp(-self.timing.interval / tau)
        by_zeta = (1.0 - phi**2) * tau**2 / (phi * self.timing.interval)
        return np.asarray(whole[np.ix_(d.used, d.used)] * by_zeta)

    @cached_property
    def derivatives(self) -> list[Array]:
        return [self.derivative(name) for name in self.estimated]

    @cached_property
    def score(self) -> Array:
        """vᵀP Σ' P v − tr(P Q_vv P Σ')."""
        weighted = self.oracle.dense.p @ self.oracle.dense.v
        return np.array([weighted @ d @ weighted - np.sum(self.oracle.scatter * d) for d in self.derivatives])

    @cached_property
    def traces(self) -> Array:
        """S: tr(P Q_vv P Σ'_g P Q_vv P Σ'_h); the estimates have the covariance 2 S⁻¹."""
        products = [self.oracle.scatter @ d for d in self.derivatives]
        return np.array([[np.sum(a * b.T) for b in products] for a in products])

    @cached_property
    def spread(self) -> Array:
        """Standard deviations of the estimates, √(2 (S⁻¹)_gg)."""
        return np.sqrt(2.0 * np.diagonal(np.linalg.inv(self.traces)))
