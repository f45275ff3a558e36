"""Which object points lie within which images.

The points are sorted into square cells once; for each image only the cells that its footprint touches are
projected, so the work grows with the number of rays and not with images times points.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.simulate import visibility_kernel

# Cells along the shorter side of a footprint: few enough to be quick, small enough to leave little out.
_CELLS = 6.0
# Cells along a side of the block at most; the largest blocks have a tenth of them.
_MOST_CELLS = 10_000
# Least downward part of a ray in units of the focal length.
_LEVEL = 0.1


@dataclass(frozen=True, eq=False)
class ImageGeometry:
    """Orientations of n images and what they need to project points.

    Attributes
    ----------
    projection_centre : (n, 3).  local_from_camera : (n, 3, 3).
    interior : (n, 3) focal length, principal point x, y, metres.
    half_format : (n, 2) metres, reduced by what is not used at the borders.
    """

    projection_centre: Floats
    local_from_camera: Floats
    interior: Floats
    half_format: Floats


def visible_rays(images: ImageGeometry, x_in_local: Floats) -> tuple[Ints, Ints]:
    """Image and point (r,) of all rays inside the formats; sorted by image, then by point."""
    begun, point = _points_inside(images, x_in_local)
    image = np.repeat(np.arange(len(begun) - 1), np.diff(begun))
    for first, last in pairwise(begun):
        point[first:last].sort()
    return image, point


def images_of_points(images: ImageGeometry, x_in_local: Floats) -> tuple[Ints, Ints]:
    """The images that see each point: where those of each point begin (m + 1,), and the images, ascending."""
    begun, point = _points_inside(images, x_in_local)
    image = np.empty_like(point)
    return visibility_kernel.by_point(begun, point, len(x_in_local), image), image


def _points_inside(images: ImageGeometry, x_in_local: Floats) -> tuple[Ints, Ints]:
    """Where the points inside each image begin (n + 1,), and the points in any order."""
    if not len(x_in_local) or not len(images.interior):
        return np.zeros(len(images.interior) + 1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    footprint = _footprints(images, x_in_local)
    side = float(np.median(np.min(footprint[:, 1] - footprint[:, 0], axis=1))) / _CELLS
    cells = _Cells.of(x_in_local, max(side, 1e-6))
    low, high = cells.within(footprint)
    # Made here: numpy asks the system for large pages, while kernels get small ones for their arrays.
    point = np.empty(visibility_kernel.points_near(low, high, cells.shape[0], cells.start), dtype=np.int64)
    begun = visibility_kernel.points_inside(
        images.projection_centre,
        images.local_from_camera,
        images.interior,
        images.half_format,
        low,
        high,
        cells.shape[0],
        cells.start,
        cells.order,
        *(np.take(x_in_local[:, k], cells.order) for k in range(3)),
        point,
    )
    return begun, point[: begun[-1]]


def _footprints(images: ImageGeometry, x_in_local: Floats) -> Floats:
    """Upright rectangles (n, 2, 2), lower and upper corner, that hold the footprints.

    The rays of the corners meet the lowest of the points' levels; higher ground is nearer and so inside.
    """
    level = float(x_in_local[:, 2].min()) if len(x_in_local) else 0.0
    signs = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])
    corners = signs[None] * images.half_format[:, None] - images.interior[:, None, 1:]
    focal = np.broadcast_to(-images.interior[:, None, :1], (*corners.shape[:2], 1))
    ray = np.einsum("nij,nkj->nki", images.local_from_camera, np.concatenate([corners, focal], axis=2))
    # Nothing is looked for where a ray is nearly level, or goes up.
    downwards = np.minimum(ray[:, :, 2], _LEVEL * focal[:, :, 0])
    distance = (level - images.projection_centre[:, None, 2]) / downwards
    ground = images.projection_centre[:, None, :2] + distance[:, :, None] * ray[:, :, :2]
    both = np.concatenate([ground, images.projection_centre[:, None, :2]], axis=1)
    return np.stack([both.min(axis=1), both.max(axis=1)], axis=1)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Points sorted by the cell of a regular grid they lie in."""

    origin: Floats
    side: float
    shape: tuple[int, int]
    start: Ints
    order: Ints

    @classmethod
    def of(cls, x_in_local: Floats, side: float) -> _Cells:
        # Axis by axis: numpy is slow along arrays with two or three columns.
        plan = np.ascontiguousarray(x_in_local[:, :2].T)
        origin = np.array([axis.min() for axis in plan])
        # Points that lie far apart compared with their footprints would need more cells than there is memory.
        side = max(
            side, max(float(axis.max() - low) for axis, low in zip(plan, origin, strict=True)) / _MOST_CELLS
        )
        column, row = (
            np.floor((axis - low) / side).astype(np.int64) for axis, low in zip(plan, origin, strict=True)
        )
        shape = int(column.max()) + 1, int(row.max()) + 1
        start, order = visibility_kernel.sorted_by(row * shape[0] + column, shape[0] * shape[1])
        return cls(origin, side, shape, start, order)

    def within(self, rectangle: Floats) -> tuple[Ints, Ints]:
        """First and last column and row (n, 2) of the cells that touch rectangles (n, 2, 2)."""
        limits = np.array(self.shape)
        place = np.clip(np.floor((rectangle - self.origin) / self.side), -1, limits).astype(np.int64)
        return np.maximum(place[:, 0], 0), np.minimum(place[:, 1], limits - 1)
