"""Heads of a platform and their virtual image, from the published relative rotations and their covariance.

A ray d = M (x, y, −c) of a head at t meets the plane Z below the platform; x_v = f (t + λ d)/Z; μ acts as
M ← Exp(μ) M, and the mean of all μ against the given heads is zero (Baarda 1973); docs/rigs.md.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from flows.stories.block_preparation import prepare_block
from flows.stories.system_calibration import calibrated_block, described_platform, publish
from tasks.results.publish import OF_CALIBRATIONS
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.store import Store
from tests.golden.delivered_block import STEP, Array, Results, angles_of, mounting, named, opk, rpy
from tests.golden.delivered_rig import BODY, small_exp
from tests.golden.oracle import computed, exactly, simulated

FLIGHT = ("flight.lines=2", "flight.exposures=4", "points.count=200")
ANGLES = ("omega", "phi", "kappa")


def platform_alone(project: Project, store: Store) -> Summary:
    """A calibration up to the platform."""
    block = prepare_block(project, store, project.calibration.free)
    one = calibrated_block(project, store, block)
    stages = (*block.stages, one.adjusted, described_platform(one, store, block))
    return publish(store, project, stages, OF_CALIBRATIONS)


@dataclass(frozen=True, eq=False)
class Heads:
    """h heads: M (h, 3, 3) platform from head, t (h, 3), c, x0, y0 (h, 3), half formats (h, 2), f; m."""

    turn: Array
    position: Array
    interior: Array
    half: Array
    f: float

    def virtual(self, head: int, xy: Array, z: float, mu: Array | None = None) -> Array:
        """Places (n, 2) in the virtual image of points of a head."""
        ray = np.column_stack([xy - self.interior[head, 1:], np.full(len(xy), -self.interior[head, 0])])
        turn = self.turn[head] if mu is None else small_exp(mu[None])[0] @ self.turn[head]
        d = ray @ turn.T
        depth = -(z + self.position[head, 2]) / d[:, 2]
        return np.asarray(self.f / z * (self.position[head, :2] + depth[:, None] * d[:, :2]))

    def in_head(self, head: int, place: Array, z: float) -> Array:
        """The way back; NaN where the ray comes from behind."""
        ground = np.column_stack([place * z / self.f, np.full(len(place), -z)])
        p = (ground - self.position[head]) @ self.turn[head]
        found = self.interior[head, 1:] - self.interior[head, 0] * p[:, :2] / p[:, 2:]
        return np.where(p[:, 2:] < 0.0, found, np.nan)

    def order(self, place: Array, z: float) -> Array:
        """(n, h) which heads show a place least far out first; −1 where it is outside their pictures."""
        out = np.stack(
            [np.abs(self.in_head(h, place, z) / self.half[h]).max(axis=1) for h in range(len(self.turn))],
            axis=1,
        )
        out = np.where(np.isfinite(out), out, np.inf)
        best = np.argsort(out, axis=1, kind="stable")
        return np.where(np.take_along_axis(out, best, axis=1) <= 1.0, best, -1)


@dataclass(frozen=True, eq=False)
class Platform:
    """Published tables of a calibration, and the heads they are computed from."""

    project: Path
    results: Results

    @cached_property
    def cameras(self) -> dict[str, dict[str, object]]:
        return dict(tomllib.loads(self.project.read_text())["cameras"])

    @cached_property
    def names(self) -> list[str]:
        return sorted(name for name, camera in self.cameras.items() if "head" in camera)

    @cached_property
    def z(self) -> float:
        """Mean height above ground."""
        return float(self.results.table("images")["height_above_ground_m"].mean())

    def parameter(self, names: Sequence[str], entity: str) -> Array:
        table = self.results.table("parameters").set_index(["parameter", "entity"])["value"]
        return np.array([table[name, entity] for name in names])

    def heads(self, rotation: Array, interior: Array) -> Heads:
        """Of roll, pitch, yaw (h, 3) in rad and c, x0, y0 (h, 3) in mm; the platform is mounted nominally."""
        own = [self.cameras[name] for name in self.names]
        axes = mounting(0).T
        turn = [axes @ rpy(r) @ mounting(c["mount_deg"]) for r, c in zip(rotation, own, strict=True)]  # type: ignore[arg-type]
        position = np.array([c["head"]["position_m"] for c in own]) @ axes.T  # type: ignore[index]
        size = np.array([[c["columns"], c["rows"]] for c in own]) * 0.5
        half = size * np.array([[c["pixel_um"]] for c in own]) * 1e-6
        f = float(self.cameras["platform"]["focal_length_mm"]) * 1e-3  # type: ignore[arg-type]
        return Heads(np.stack(turn), position, interior * 1e-3, half, f)

    @cached_property
    def given(self) -> Heads:
        own = [self.cameras[name] for name in self.names]
        stated = np.radians([c["head"]["rotation_deg"] for c in own])  # type: ignore[index]
        return self.heads(stated, np.array([[c["focal_length_mm"], *c["principal_point_mm"]] for c in own]))  # type: ignore[misc]

    @cached_property
    def found(self) -> Array:
        """Roll, pitch, yaw (h, 3) as adjusted."""
        names = [f"relative_rotation_{axis}" for axis in BODY]
        return np.radians([self.parameter(names, name) for name in self.names])

    @cached_property
    def adjusted(self) -> Heads:
        names = ["focal_length", "principal_point_x", "principal_point_y"]
        heads = self.heads(self.found, np.array([self.parameter(names, name) for name in self.names]))
        for _ in range(5):
            mean = small(heads.turn, self.given.turn).mean(axis=0)
            heads = replace(heads, turn=small_exp(-mean[None])[0] @ heads.turn)
        return heads

    @cached_property
    def covariance(self) -> Array:
        """(3 h, 3 h) of μ in the datum Σ μ = 0."""
        h = len(self.names)
        keys = [(f"relative_rotation_{axis}", name) for name in self.names for axis in BODY]
        table = self.results.table("parameters").set_index(["parameter", "entity"])
        sigma, place = (
            np.radians([table.loc[key, "sigma"] for key in keys]),
            {k: n for n, k in enumerate(keys)},
        )
        correlation, pairs = np.eye(3 * h), self.results.table("correlations")
        for a, b, value in zip(named(pairs, "_a"), named(pairs, "_b"), pairs["correlation"], strict=True):
            if a in place and b in place:
                correlation[place[a], place[b]] = correlation[place[b], place[a]] = value
        of_angles = np.zeros((3 * h, 3 * h))
        for n in range(h):
            for k in range(3):
                moved = self.found[n].astype(complex)
                moved[k] += 1j * STEP
                change = mounting(0).T @ (rpy(moved).imag / STEP @ rpy(self.found[n]).T) @ mounting(0)
                of_angles[3 * n : 3 * n + 3, 3 * n + k] = change[2, 1], change[0, 2], change[1, 0]
        datum = np.eye(3 * h) - np.kron(np.ones((h, h)) / h, np.eye(3))
        gain = datum @ of_angles * sigma
        return np.asarray(gain @ correlation @ gain.T)


def small(turn: Array, given: Array) -> Array:
    """Rotation vectors (h, 3) of turn · givenᵀ."""
    r = turn @ np.swapaxes(given, 1, 2)
    axial = 0.5 * np.stack(
        [r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1
    )
    sine = np.linalg.norm(axial, axis=1, keepdims=True)
    return np.asarray(axial * np.arcsin(sine) / np.where(sine > 0.0, sine, 1.0))


@pytest.fixture(scope="module")
def platform(tmp_path_factory: pytest.TempPathFactory) -> Platform:
    project = simulated(tmp_path_factory.mktemp("platform"), "dmc-heads", FLIGHT)
    return Platform(project, computed(project, story=platform_alone))


def test_heads(platform: Platform) -> None:
    table = platform.results.table("platform").set_index("head").loc[platform.names]
    turn, h = platform.adjusted.turn, len(platform.names)
    for name, angles in (("", angles_of(turn)), ("given_", angles_of(platform.given.turn))):
        exactly(
            table[[f"{name}{a}_deg" for a in ANGLES]], np.degrees(angles), "attitudes", of=1.0, tolerance=1e-9
        )
    exactly(table[["x_m", "y_m", "z_m"]], platform.adjusted.position, "positions", of=1.0, tolerance=1e-12)
    gain = np.zeros((3 * h, 3 * h))
    for n, angles in enumerate(angles_of(turn)):
        columns = []
        for k in range(3):
            moved = angles.astype(complex)
            moved[k] += 1j * STEP
            change = opk(moved).imag / STEP @ opk(angles).T
            columns.append([change[2, 1], change[0, 2], change[1, 0]])
        gain[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] = np.linalg.inv(np.array(columns).T)
    covariance = gain @ platform.covariance @ gain.T
    sigma = np.sqrt(np.diagonal(covariance))
    exactly(table[[f"sigma_{a}_deg" for a in ANGLES]], np.degrees(sigma).reshape(h, 3), "σ", tolerance=1e-7)
    correlation = np.abs(covariance / np.outer(sigma, sigma))
    mu = small(turn, platform.given.turn)
    for n, name in enumerate(platform.names):
        own = slice(3 * n, 3 * n + 3)
        chi2 = mu[n] @ np.linalg.solve(platform.covariance[own, own], mu[n])
        exactly(table.loc[name, "probability"], stats.chi2.sf(chi2, 3), "probability", tolerance=1e-6)
        others = {m: correlation[own, 3 * m : 3 * m + 3].max() for m in range(h) if m != n}
        strongest = max(others, key=lambda m: others[m])
        assert table.loc[name, "correlated_with"] == platform.names[strongest]
        exactly(table.loc[name, "correlation"], others[strongest], "correlation", tolerance=1e-7)


def test_virtual_image(platform: Platform) -> None:
    table, z = platform.results.table("virtual_image"), platform.z
    place = table[["x_mm", "y_mm"]].to_numpy() * 1e-3
    adjusted, given = platform.adjusted, platform.given
    h = len(platform.names)
    by_given, by_adjusted = given.order(place, z)[:, :2], adjusted.order(place, z)[:, 0]
    numbers = [name for name in table if name not in ("platform", "head", "next_head", "x_mm", "y_mm")]
    expected = {name: np.full(len(place), np.nan) for name in numbers}
    heads = {name: np.full(len(place), "", dtype=object) for name in ("head", "next_head")}

    def fill(n: int, names: Sequence[str], values: Array) -> None:
        for name, value in zip(names, values, strict=True):
            expected[name][n] = value

    for n in range(len(place)):
        (head, beside), at = by_given[n], place[n : n + 1]
        if head < 0:
            continue
        own = adjusted.in_head(head, at, z)
        fill(n, ("head_x_mm", "head_y_mm"), own[0] * 1e3)
        taken = given.in_head(head, at, z)
        fill(n, ("dx_um", "dy_um"), (at - adjusted.virtual(head, taken, z))[0] * 1e6)
        if (shown_by := by_adjusted[n]) >= 0:
            seen = adjusted.in_head(shown_by, at, z)
            fill(n, ("seam_x_um", "seam_y_um"), (at - adjusted.virtual(shown_by, seen, 0.9 * z))[0] * 1e6)
        design = of_rotation(adjusted, head, own, z, h)
        fill(n, ("sigma_x_um", "sigma_y_um", "correlation"), spread_of(design, platform.covariance))
        heads["head"][n] = platform.names[head]
        if beside >= 0:
            heads["next_head"][n] = platform.names[beside]
            step = design - of_rotation(adjusted, beside, adjusted.in_head(beside, at, z), z, h)
            names = ("sigma_step_x_um", "sigma_step_y_um", "correlation_step")
            fill(n, names, spread_of(step, platform.covariance))
    for name, values in heads.items():
        assert table[name].fillna("").tolist() == values.tolist(), name
    assert table["next_head"].notna().any()
    for name, values in expected.items():
        known = np.isfinite(values)
        np.testing.assert_array_equal(table[name].notna(), known, err_msg=name)
        of = np.maximum(np.abs(values[known]), 1.0)
        exactly(table.loc[known, name], values[known], name, of=of, tolerance=1e-7)


def of_rotation(heads: Heads, head: int, xy: Array, z: float, h: int) -> Array:
    """(2, 3 h) Derivatives of a place in the virtual image by μ of all heads."""
    found = np.zeros((2, 3 * h))
    for k in range(3):
        found[:, 3 * head + k] = heads.virtual(head, xy, z, 1j * STEP * np.eye(3)[k])[0].imag / STEP
    return found


def spread_of(design: Array, covariance: Array) -> Array:
    """σ along both axes, µm, and their correlation."""
    spread = design @ covariance @ design.T
    sigma = np.sqrt(np.diagonal(spread))
    return np.array([*(sigma * 1e6), spread[0, 1] / sigma.prod()])
