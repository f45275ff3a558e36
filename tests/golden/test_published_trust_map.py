"""The trust map by dense algebra, from the delivered files and the adjusted values.

Cells, their images, heights and derivatives are computed here; formulas: docs/theory/trust-map.md.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.golden.delivered_block import PLACE, Array
from tests.golden.delivered_ground import Ground, heights_over_triangles
from tests.golden.oracle import (
    DELTA0,
    Case,
    Oracle,
    nothing,
    same,
    with_distances,
    with_own_sigmas_and_distances,
)

XYZ = ("x", "y", "z")
CASES = {
    "a map, distances, a σ of its own for every coordinate": Case(
        (
            "project.crs=EPSG:25832",
            "project.latitude_deg=48.9",
            "project.longitude_deg=10.7",
            "project.angles=omega-phi-kappa",
            "truth.strip_bias_m=[0.03,0.03,0.05]",
        ),
        with_own_sigmas_and_distances,
        ("trust_map={cell_m=500}",),
    ),
    "correlation in time, calibrated distortion": Case(
        (
            "noise.gnss_m=[0,0,0]",
            "noise.gnss_markov_m=[0.05,0.05,0.06]",
            "noise.ins_deg=[0,0,0]",
            "noise.ins_markov_deg=[0.003,0.003,0.008]",
            "truth.image_errors.radial_um=5",
        ),
        nothing,
        (
            "adjustment.sigma0=a_priori",
            'adjustment.self_calibration={parameters="brown:K1,P1,B1", elimination="none"}',
            "trust_map={cell_m=400, sigma_image_um=1.5, share=0.8,"
            "area_m=[[-1500,-1500],[3500,-1000],[1500,2500]]}",
        ),
    ),
    "variance components, distances, cells in between": Case(
        ("noise.gnss_m=[0.02,0.02,0.10]", "truth.focal_length_change_mm=0.01"),
        with_distances,
        ("adjustment.variance_components=true", "trust_map={cell_m=200}"),
    ),
}


@dataclass(frozen=True, eq=False)
class Map:
    """A published map, its settings, and what it is computed from."""

    oracle: Oracle
    settings: dict[str, Any]

    @cached_property
    def table(self) -> pd.DataFrame:
        return self.oracle.results.table("trust_map_cells")

    @cached_property
    def grid(self) -> dict[str, Any]:
        return dict(self.oracle.results.summary["trust_map_grid"])

    @cached_property
    def ground(self) -> Ground:
        return Ground(self.oracle, self.table[list(PLACE)].to_numpy())

    @property
    def sigma(self) -> float:
        return float(self.grid["sigma_image_um"]) * 1e-6

    @cached_property
    def covariance(self) -> Array:
        """σ0² Q of all unknowns."""
        return np.asarray(self.oracle.factor**2 * self.oracle.dense.q)

    def columns(self, pattern: str) -> Array:
        return self.table[[pattern.format(axis) for axis in XYZ]].to_numpy()

    def sigma_of(self, cell: int, images: Sequence[int]) -> Array:
        _, b, g = self.ground.point(cell, images)
        variance = self.sigma**2 * np.diagonal(g @ g.T) + of_rows(g @ b, self.covariance)
        return np.asarray(np.sqrt(variance))

    @cached_property
    def common_points(self) -> Array:
        """(n, n) Which images have an object point in common."""
        block = self.oracle.block
        seen_in = pd.Series(block.ray_image).groupby(block.ray_point).agg(list)
        return together(seen_in, len(block.images))

    @cached_property
    def effects(self) -> Array:
        """Effects (m, 3, n) of the smallest errors that are found in the scalars of the block."""
        oracle, d = self.oracle, self.oracle.dense
        detectable = DELTA0 / np.sqrt(np.diagonal(oracle.scatter))
        detectable[np.diagonal(oracle.scatter) * np.diagonal(d.covariance) < 0.1] = 0.0
        moved = d.q @ d.a.T @ d.p * detectable
        points = [self.ground.point(cell, images) for cell, images in enumerate(self.ground.images)]
        return np.stack([-g @ b @ moved for _, b, g in points])


def together(groups: Iterable[Iterable[int]], n: int) -> Array:
    """(n, n) Which of n images are together in one of the groups."""
    found = np.zeros((n, n), dtype=bool)
    for group in groups:
        found[np.ix_(list(group), list(group))] = True
    return found


def of_rows(rows: Array, covariance: Array) -> Array:
    """The diagonal of F C Fᵀ."""
    return np.asarray(np.sum((rows @ covariance) * rows, axis=1))


@pytest.fixture(scope="module", params=CASES)
def trust_map(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Map:
    case = CASES[request.param]
    oracle = Oracle.of_case(case, tmp_path_factory.mktemp("delivered"))
    return Map(oracle, tomllib.loads(case.adjusted[-1])["trust_map"])


def test_cells_and_the_images_that_see_them(trust_map: Map) -> None:
    grid, settings, block = trust_map.grid, trust_map.settings, trust_map.oracle.block
    over = np.array(settings.get("area_m", block.map_of_point[:, :2]), dtype=float)
    cell = settings["cell_m"]
    first, last = np.floor(over.min(axis=0) / cell), np.floor(over.max(axis=0) / cell)
    columns, rows = (last - first + 1).astype(int)
    west, north = first[0] * cell, (last[1] + 1) * cell
    expected = {"west_m": west, "north_m": north, "cell_m": cell, "rows": rows, "columns": columns}
    assert {name: grid[name] for name in expected} == expected
    row, column = (k.ravel() for k in np.indices((rows, columns)))
    plan = np.column_stack([west + (column + 0.5) * cell, north - (row + 0.5) * cell])
    inside = np.ones(len(plan), dtype=bool)
    if "area_m" in settings:  # to the left of every side
        sides = np.roll(over, -1, axis=0) - over
        away = plan[:, None] - over
        inside = (sides[:, 0] * away[..., 1] - sides[:, 1] * away[..., 0] > 0.0).all(axis=1)
    assert grid["area_cells"] == (inside.sum() if "area_m" in settings else None)
    heights = heights_over_triangles(block.map_of_point, plan)
    known = np.flatnonzero(inside & np.isfinite(heights))
    every = Ground(trust_map.oracle, np.column_stack([plan[known], heights[known]]))
    rays = np.array([len(images) for images in every.images])
    seen, table = known[rays >= 2], trust_map.table
    np.testing.assert_array_equal(table[["row", "column"]], np.column_stack([row[seen], column[seen]]))
    same(table[list(PLACE)], every.places[rays >= 2], "places", of=1.0, tolerance=1e-6)
    np.testing.assert_array_equal(table["rays"], rays[rays >= 2])
    assert grid["cells"] == len(table)
    sigma = np.median(np.sqrt(np.diagonal(trust_map.oracle.dense.covariance))[: 2 * len(block.rays)])
    stated = settings.get("sigma_image_um", 1e6 * sigma * trust_map.oracle.factor)
    same(grid["sigma_image_um"], stated, "σ of an image coordinate")


def test_standard_deviations(trust_map: Map) -> None:
    images = trust_map.ground.images
    found = [trust_map.sigma_of(cell, own) for cell, own in enumerate(images)]
    same(trust_map.columns("sigma_{}_m"), found, "σ", tolerance=1e-8)
    for cell, own in enumerate(images):
        pairs = [trust_map.sigma_of(cell, pair) for pair in combinations(own, 2)]
        found[cell] = min(pairs, key=lambda sigma: float(sigma[2]))
    same(trust_map.columns("pair_sigma_{}_m"), found, "σ of the best pair", tolerance=1e-8)


def test_relative_standard_deviations(trust_map: Map) -> None:
    ground, relative = trust_map.ground, trust_map.columns("relative_sigma_{}_m")
    place = list(zip(trust_map.table["row"], trust_map.table["column"], strict=True))
    number, compared = {at: k for k, at in enumerate(place)}, 0
    for cell, (row, column) in enumerate(place):
        neighbour = number.get((row, column + 1), -1)
        common = sorted({*ground.images[cell]} & {*ground.images[neighbour]}) if neighbour >= 0 else []
        if len(common) < 2:
            assert np.isnan(relative[cell]).all()
            continue
        (_, b, g), (_, b_next, g_next) = (ground.point(k, common) for k in (cell, neighbour))
        variance = trust_map.sigma**2 * np.diagonal(g @ g.T + g_next @ g_next.T)
        variance = variance + of_rows(g @ b - g_next @ b_next, trust_map.covariance)
        same(relative[cell], np.sqrt(variance), "relative σ", tolerance=1e-8)
        compared += 1
    assert compared > len(place) // 2


def test_errors_in_new_image_coordinates(trust_map: Map) -> None:
    external = np.zeros((len(trust_map.table), 3))
    uncontrolled = np.zeros(len(external), dtype=int)
    for cell, images in enumerate(trust_map.ground.images):
        a, b, g = trust_map.ground.point(cell, images)
        r = np.eye(len(a)) - a @ g
        sigma = np.sqrt(of_rows(r, trust_map.sigma**2 * np.eye(len(a)) + b @ trust_map.covariance @ b.T))
        control = np.diagonal(r)
        told = control >= 0.1
        uncontrolled[cell] = (~told).sum()
        effects = g[:, told] * (DELTA0 * sigma / control)[told]
        external[cell] = np.abs(effects).max(axis=1, initial=0.0)
    np.testing.assert_array_equal(trust_map.table["uncontrolled"], uncontrolled)
    same(trust_map.columns("external_{}_m"), external, "external reliability", tolerance=1e-8)


def test_errors_in_the_block(trust_map: Map) -> None:
    oracle = trust_map.oracle
    rays = np.array([key[0] == "image_points" for key in oracle.keys])
    distances = np.array([key[0].startswith("distances:") for key in oracle.keys])
    block = np.abs(trust_map.effects[:, :, ~rays & ~distances]).max(axis=2)
    if distances.any():  # which are not counted, although some would be the largest
        assert (np.abs(trust_map.effects[:, :, distances]).max(axis=2) > block).any()
    image = np.array([oracle.block.image_number[key[1]] for key in oracle.keys if key[0] == "image_points"])
    effects, of_rays = np.abs(trust_map.effects[:, :, rays]), np.zeros_like(block)
    for cell, images in enumerate(trust_map.ground.images):
        around = trust_map.common_points[images].any(axis=0)
        of_rays[cell] = effects[cell][:, around[image]].max(axis=1)
    for pattern, expected in (("block_error_{}_m", block), ("ray_error_{}_m", of_rays)):
        found = trust_map.columns(pattern)
        exact = (np.abs(found - expected) <= 1e-7 * expected).all(axis=1)
        if len(found) <= 300:
            assert exact.all()
            continue
        # One of every square; between them nine of ten are as near as docs/theory/trust-map.md says.
        assert exact.sum() >= 75
        ratio = (found / expected)[~exact]
        assert (((ratio > 0.7) & (ratio < 1.6)).mean(axis=0) >= 0.9).all()
        assert (((ratio > 0.5) & (ratio < 2.2)).mean(axis=0) >= 0.98).all()
        assert ratio.min() > 0.35


def test_pairs_of_images_without_a_common_point(trust_map: Map) -> None:
    oracle = trust_map.oracle
    block, n = oracle.block, len(oracle.block.images)
    in_time = list[tuple[int, int]]()
    if block.settings.get("gnss_correlation_s"):
        for strip in set(block.strip):
            own = np.flatnonzero(np.array(block.strip) == strip)
            order = own[np.argsort(block.time[own])].tolist()
            in_time += [*pairwise(order), *zip(order, order[2:], strict=False)]
    related = trust_map.common_points | together(in_time, n)
    added = together(trust_map.ground.images, n) & ~related
    assert trust_map.grid["added_pairs"] == np.triu(added, 1).sum()


def test_figures(trust_map: Map) -> None:
    table, figure = trust_map.table, trust_map.oracle.results.summary["trust_map"]
    cells = trust_map.grid["area_cells"] or len(table)
    share = trust_map.settings.get("share", 0.95)

    def at(values: Array, place: int) -> list[float | None]:
        """Of each column the value that so many others are smaller than."""
        found = [sorted(column)[place] if place < len(column) else np.inf for column in values.T]
        return [float(value) if np.isfinite(value) else None for value in found]

    last, middle = int(np.ceil(share * cells)) - 1, (len(table) - 1) // 2
    largest = np.maximum(trust_map.columns("external_{}_m"), trust_map.columns("block_error_{}_m"))
    largest = np.maximum(largest, trust_map.columns("ray_error_{}_m"))
    open_ones = (table["uncontrolled"] > 0).to_numpy()
    largest[open_ones] = np.inf
    relative = trust_map.columns("relative_sigma_{}_m")
    relative = relative[np.isfinite(relative).all(axis=1)]
    expected = {
        "cells": len(table),
        "unmapped": 1.0 - len(table) / cells,
        "cell_m": trust_map.settings["cell_m"],
        "share": share,
        "sigma_image_um": trust_map.grid["sigma_image_um"],
        "median_rays": table["rays"].median(),
        "median_sigma_m": at(trust_map.columns("sigma_{}_m"), middle),
        "sigma_m": at(trust_map.columns("sigma_{}_m"), last),
        "pair_sigma_m": at(trust_map.columns("pair_sigma_{}_m"), last),
        "relative_sigma_m": at(relative, (len(relative) - 1) // 2),
        "external_m": at(largest, last),
        "block_error_m": at(trust_map.columns("block_error_{}_m"), last),
        "ray_error_m": at(trust_map.columns("ray_error_{}_m"), last),
        "uncontrolled": open_ones.mean(),
    }
    assert set(figure) == set(expected)
    for name, value in expected.items():
        known = value if isinstance(value, list) else [value]
        found = figure[name] if isinstance(value, list) else [figure[name]]
        assert [v is None for v in found] == [v is None for v in known], name
        same([v or 0.0 for v in found], [v or 0.0 for v in known], name, tolerance=1e-12)
    gates = trust_map.oracle.results.summary
    sigma, external = expected["sigma_m"], expected["external_m"]
    plan = [value for value in sigma[:2] if value is not None]
    assert gates["trust_map_plan_m"] == max(plan, default=None)
    assert gates["trust_map_height_m"] == sigma[2]
    assert gates["trust_map_external_m"] == (None if None in external else max(external))
