"""Refraction of image points from the formulas of the reference, at delivered orientations.

dα = K tan α, K = 2.26e-4 [(p(h) − p(H)) / (g (H − h)) − ρ(H)] in flat layers of the ICAO atmosphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def pressure(h: Array) -> Array:
    """Pa at a height, m."""
    return np.asarray(101325.0 * (1.0 - 0.0065 * h / 288.15) ** 5.25588)


def coefficient(of_camera: Array, of_ground: Array) -> Array:
    """K of rays between two heights, m."""
    density = pressure(of_camera) / (287.05 * (288.15 - 0.0065 * of_camera))
    layers = (pressure(of_ground) - pressure(of_camera)) / (9.80665 * (of_camera - of_ground))
    return np.asarray(2.26e-4 * (layers - density))


def intersections(centre: Array, attitude: Array, xy: Array, c: Array, point: Array, sigma: Array) -> Array:
    """Places (m, 3) whose image points are nearest to those measured, of m points.

    Parameters
    ----------
    centre, attitude : (n, 3), (n, 3, 3) of each ray.
    xy, c, point, sigma : (n, 2) from the principal point, principal distance, number of the point, (n, 2).
    """
    ray = np.einsum("nij,nj->ni", attitude, np.column_stack([xy, -c]))
    unit = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    rows, right = np.eye(3) - unit[:, :, None] * unit[:, None, :], centre
    right = np.einsum("nij,nj->ni", rows, right)
    found = np.zeros((point.max() + 1, 3))
    for _ in range(5):  # from the place nearest to the rays
        normal, of_right = np.zeros((len(found), 3, 3)), np.zeros_like(found)
        np.add.at(normal, point, np.swapaxes(rows, 1, 2) @ rows)
        np.add.at(of_right, point, np.einsum("nji,nj->ni", rows, right))
        found = found + np.linalg.solve(normal, of_right[:, :, None])[:, :, 0]
        p = np.einsum("nji,nj->ni", attitude, found[point] - centre)
        image = -c[:, None] * p[:, :2] / p[:, 2:]
        slope = -c[:, None, None] / p[:, 2, None, None] * np.eye(2)
        rows = np.concatenate([slope, -(image / p[:, 2:])[:, :, None]], axis=2) @ np.swapaxes(attitude, 1, 2)
        rows, right = rows / sigma[:, :, None], (xy - image) / sigma
    return found


@dataclass(frozen=True, eq=False)
class Refraction:
    """Of n rays.

    Attributes
    ----------
    interior : (n, 3) c, x0, y0, m.
    down : (n, 3) nadir in the axes of the camera.
    height : (n,) of the projection centres, m.
    k : (n,) coefficients K.
    """

    interior: Array
    down: Array
    height: Array
    k: Array

    def straight(self, xy: Array) -> Array:
        """Image points (n, 2) of the straight rays: turned towards the nadir by K tan α (Rodrigues)."""
        ray = np.column_stack([xy - self.interior[:, 1:], -self.interior[:, 0]])
        axis = np.cross(ray, self.down)
        tangent = np.linalg.norm(axis, axis=1) / np.sum(ray * self.down, axis=1)
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        angle = (self.k * tangent)[:, None]
        ray = ray * np.cos(angle) + np.cross(axis, ray) * np.sin(angle)  # axis and ray are orthogonal
        return np.asarray(self.interior[:, 1:] - self.interior[:, :1] * ray[:, :2] / ray[:, 2:])

    def bent(self, xy: Array) -> Array:
        """Image points (n, 2) as they are measured, from those of the straight rays."""
        found = xy
        for _ in range(5):  # each leaves 1e-4 of it
            found = found + xy - self.straight(found)
        return found
