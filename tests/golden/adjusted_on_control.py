"""The first of two steps by dense algebra: a block at the minimum of image points and control alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from tests.golden.delivered_block import Array, Results, Solved, named
from tests.golden.dense_adjustment import at_minimum
from tests.golden.strips_of_two_steps import Strips


@dataclass(frozen=True, eq=False)
class OnControl:
    """The block at the minimum of image points and control, with the cameras of the first step."""

    project: Path
    first: Results

    @cached_property
    def dense(self) -> Solved:
        stated = self.project.read_text().replace("[adjustment]", '[adjustment]\nobserve = ["control"]')
        alone = self.project.with_name("on_control.toml")
        alone.write_text(stated)
        names = ("exterior_orientations", "object_points", "parameters")
        tables = {name: self.first.table(name) for name in names}
        tables["parameters"] = tables["parameters"].assign(status="fixed")
        return at_minimum(alone, self.first.folder, tables)

    @cached_property
    def covariance(self) -> Array:
        """Of all orientations: σ0² Q + G Σ_c Gᵀ, G = −Q Aᵀ P A_c of the parameters of the first step."""
        d = self.dense
        n = 6 * len(d.d.images)
        table = self.first.table("parameters")
        known = table[table["sigma"].notna() & (table["entity"] == "UCE-80")]
        names = named(known)
        sigma = known["sigma"].to_numpy() * d.d.factor[known.index]
        correlation, place = np.eye(len(names)), {name: k for k, name in enumerate(names)}
        pairs = self.first.table("correlations")
        for a, b, value in zip(named(pairs, "_a"), named(pairs, "_b"), pairs["correlation"], strict=True):
            if a in place and b in place:
                correlation[place[a], place[b]] = correlation[place[b], place[a]] = value
        first = len(d.x0) - len(d.d.g)
        of_camera = np.stack([d.derivative(first + k) for k in known.index], axis=1)
        gain = -(d.q @ d.a.T @ d.p @ of_camera)[:n] * sigma
        return np.asarray(d.sigma0**2 * d.q[:n, :n] + gain @ correlation @ gain.T)

    @cached_property
    def strips(self) -> Strips:
        block = self.dense.d
        return Strips(block.given, block.centre, block.angles, self.covariance)
