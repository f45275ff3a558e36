"""The block-sparse pattern of the reduced normal equations: pairs of images with common points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Ints
from adjust.observations.image_point import ImagePoints
from adjust.solve import covisibility_kernel


@dataclass(frozen=True, eq=False)
class Covisibility:
    """Pairs (i, j), i ≤ j, of images that see a common point, row by row, diagonal first.

    Attributes
    ----------
    row_start : (n + 1,) where row i begins.
    column : (blocks,) ascending within a row.
    """

    row_start: Ints
    column: Ints

    @property
    def images(self) -> int:
        """Number of images n."""
        return len(self.row_start) - 1

    @property
    def diagonal(self) -> Ints:
        """(n,) position of the diagonal blocks."""
        return self.row_start[:-1]

    @property
    def row(self) -> Ints:
        """(blocks,) row of every block."""
        return np.repeat(np.arange(self.images), np.diff(self.row_start))


def point_starts(point: Ints, points: int) -> Ints:
    """(points + 1,) where the rays of each object point begin in a list sorted by point."""
    return np.searchsorted(point, np.arange(points + 1)).astype(np.int64)


def covisibility(image_points: ImagePoints, images: int, points: int) -> Covisibility:
    """The pattern of a set of image points; rejected ones count, so that it serves every pass."""
    by_image = np.argsort(image_points.image, kind="stable")
    image_start = np.searchsorted(image_points.image[by_image], np.arange(images + 1)).astype(np.int64)
    row_start, column = covisibility_kernel.upper_pattern(
        image_start,
        image_points.point[by_image],
        point_starts(image_points.point, points),
        image_points.image,
        images,
    )
    return Covisibility(row_start, column)
