"""Which object points lie within which images.

The points are sorted into square cells once; for each image only the cells that its footprint touches are
projected, so the work grows with the number of rays and not with images times points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints

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
    footprint = _footprints(images, x_in_local)
    side = float(np.median(np.min(footprint[:, 1] - footprint[:, 0], axis=1))) / _CELLS
    cells = _Cells.of(x_in_local, max(side, 1e-6))
    found = []
    for i in range(len(images.interior)):
        candidates = cells.within(footprint[i])
        kept = candidates[_inside(images, i, x_in_local[candidates])]
        found.append(np.sort(kept))
    count = np.array([len(points) for points in found])
    image = np.repeat(np.arange(len(found), dtype=np.int64), count)
    return image, np.concatenate(found).astype(np.int64)


def _inside(images: ImageGeometry, i: int, x_in_local: Floats) -> Bools:
    """Whether points (m, 3) fall into image i; no image errors considered."""
    p = (x_in_local - images.projection_centre[i]) @ images.local_from_camera[i]
    focal, x0, y0 = images.interior[i]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = x0 - focal * p[:, 0] / p[:, 2]
        y = y0 - focal * p[:, 1] / p[:, 2]
    half = images.half_format[i]
    return np.asarray((p[:, 2] < 0.0) & (np.abs(x) < half[0]) & (np.abs(y) < half[1]))


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
        plan = x_in_local[:, :2]
        origin = plan.min(axis=0)
        # Points that lie far apart beside their footprints would need more cells than there is memory.
        side = max(side, float(np.max(plan.max(axis=0) - origin)) / _MOST_CELLS)
        column_row = np.floor((plan - origin) / side).astype(np.int64)
        shape = tuple(column_row.max(axis=0) + 1)
        code = column_row[:, 1] * shape[0] + column_row[:, 0]
        order = np.argsort(code, kind="stable").astype(np.int64)
        start = np.searchsorted(code[order], np.arange(shape[0] * shape[1] + 1)).astype(np.int64)
        return cls(origin, side, (int(shape[0]), int(shape[1])), start, order)

    def within(self, rectangle: Floats) -> Ints:
        """Points of all cells that touch a rectangle (2, 2)."""
        limits = np.array(self.shape)
        low, high = np.clip(np.floor((rectangle - self.origin) / self.side), -1, limits).astype(np.int64)
        low, high = np.maximum(low, 0), np.minimum(high, limits - 1)
        if np.any(high < low):
            return np.empty(0, dtype=np.int64)
        rows = [
            self.order[
                self.start[row * self.shape[0] + low[0]] : self.start[row * self.shape[0] + high[0] + 1]
            ]
            for row in range(low[1], high[1] + 1)
        ]
        return np.concatenate(rows)
