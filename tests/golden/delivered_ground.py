"""What is seen of places on the ground, by the equations of `delivered_block`."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from tests.golden.delivered_block import STEP, Array, turned
from tests.golden.oracle import Oracle


@dataclass(frozen=True, eq=False)
class Ground:
    """What is seen of the middles of cells.

    Attributes
    ----------
    places : (m, 3) in the map.
    """

    oracle: Oracle
    places: Array

    @cached_property
    def both(self) -> tuple[Array, Array]:
        """Places (m, 3) in the frame of the adjustment, and local from grid (m, 3, 3)."""
        return self.oracle.block.both(self.places)

    @cached_property
    def rays(self) -> list[tuple[int, int]]:
        """Cell and image of every ray: the image point lies inside the format, without distortion."""
        block, found = self.oracle.block, list[tuple[int, int]]()
        centre, attitude, _ = block.body(np.hstack([np.zeros_like(block.angles), block.angles]), block.g)
        for k, name in enumerate(block.camera):
            camera = block.project["cameras"][name]
            interior = block.of(block.g, ("focal_length", "principal_point_x", "principal_point_y"), [name])
            half = np.array([camera["columns"], camera["rows"]]) * camera["pixel_um"] * 0.5e-6
            p = (self.both[0] - centre[k]) @ attitude[k]
            xy = -interior[0, 0] * p[:, :2] / p[:, 2:] + interior[0, 1:]
            inside = (p[:, 2] < 0) & (np.abs(xy) <= half).all(axis=1)
            found += [(cell, k) for cell in np.flatnonzero(inside)]
        return sorted(found)

    @cached_property
    def images(self) -> list[list[int]]:
        found: list[list[int]] = [[] for _ in self.places]
        for cell, image in self.rays:
            found[cell].append(image)
        return found

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """Of image coordinates, rays (r, 2, …): by the point in axes of the cell; by all other unknowns."""
        block, cells, dense = copy.copy(self.oracle.block), self.both, self.oracle.dense
        cell, image = np.array(self.rays).T
        block.places, block.ray_point, block.ray_image = {}, cell, image
        block.ray_camera = [block.camera[k] for k in image]
        block.place, block.point_axes = cells
        n, m = len(block.images), len(self.places)
        exposure = np.hstack([np.zeros((n, 3)), block.angles])
        block.xy = np.zeros((len(cell), 2))

        def misclosure(e: Array, x: Array, g: Array) -> Array:
            centre, attitude, _ = block.body(e, g)
            place = block.place + turned(block.point_axes, x)
            return block._of_image_points(centre, attitude, place, g).reshape(-1, 2)

        at = np.zeros((m, 3))
        for _ in range(8):  # where they are measured, with distortion
            block.xy = block.xy + misclosure(exposure, at, block.g)
        of_point, of_rest = np.zeros((len(cell), 2, 3)), np.zeros((len(cell), 2, dense.q.shape[0]))

        def derivative(e: Any = 0.0, x: Any = 0.0, g: Any = 0.0) -> Array:
            return misclosure(exposure + e, at + x, block.g + g).imag / STEP

        for k in range(3):
            of_point[:, :, k] = derivative(x=1j * STEP * np.eye(3)[k])
        for k in range(6):
            of_rest[np.arange(len(cell)), :, 6 * image + k] = derivative(e=1j * STEP * np.eye(6)[k])
        for name, column in self.oracle.free.items():
            own = np.eye(len(block.g))[block.number[name]]
            of_rest[:, :, column] = derivative(g=1j * STEP * own)
        return of_point, of_rest

    def point(self, cell: int, images: Sequence[int]) -> tuple[Array, Array, Array]:
        """A (2 k, 3), B (2 k, u) and G = (AᵀA)⁻¹ Aᵀ of a point measured in some images."""
        rows = [self.number[cell, image] for image in images]
        a, b = (part[rows].reshape(2 * len(rows), -1) for part in self.derivatives)
        return a, b, np.linalg.inv(a.T @ a) @ a.T

    @cached_property
    def number(self) -> dict[tuple[int, int], int]:
        return {ray: k for k, ray in enumerate(self.rays)}


def heights_over_triangles(points: Array, plan: Array) -> Array:
    """Heights of places (n, 2) over the triangles of points (m, 3) with nothing in their circumcircles."""
    found, origin = np.full(len(plan), np.nan), points[:, :2].mean(axis=0)
    x, y = (points[:, :2] - origin).T
    corners = np.array(list(combinations(range(len(points)), 3)))
    of_corners = np.stack([x[corners], y[corners], np.ones(corners.shape)], axis=2)
    wide = np.abs(np.linalg.det(of_corners)) > 1.0
    corners, of_corners = corners[wide], of_corners[wide]
    circle = np.linalg.solve(of_corners, (x**2 + y**2)[corners][:, :, None])[:, :, 0]
    power = x**2 + y**2 - circle @ np.stack([x, y, np.ones_like(x)])
    empty = (power > -1e-3).all(axis=1)
    at = np.column_stack([plan - origin, np.ones(len(plan))])
    for i, m in zip(corners[empty], of_corners[empty], strict=True):
        weight = at @ np.linalg.inv(m)
        own = (weight >= 0.0).all(axis=1)
        found[own] = weight[own] @ points[i, 2]
    return found
