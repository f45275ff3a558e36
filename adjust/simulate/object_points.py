"""Object points: a jittered grid over the ground that several images see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.geometry.earth import LocalFrame
from adjust.simulate.terrain import Terrain, raised
from adjust.simulate.visibility import ImageGeometry, visible_rays

_COARSE = 100
# Cameras inclined by more see far, but hardly up to the horizon.
_OBLIQUE, _HORIZON = np.deg2rad(15.0), np.deg2rad(75.0)
# Positions that are tried for one point that is found.
_MOST_TRIALS = 1_000
# A point keeps this part of its cell's side between itself and the border of the cell.
_JITTER = 0.4


@dataclass(frozen=True)
class PointSpecification:
    """Tie points.

    Attributes
    ----------
    count : expected number of object points with enough image points.
    detection : probability that a point is found in an image that shows it.
    rays : least number of image points of an object point; others are lost.
    margin : part of the half format along the borders in which nothing is measured.
    """

    count: int
    detection: float = 1.0
    rays: int = 2
    margin: float = 0.02


@dataclass(frozen=True, eq=False)
class Coverage:
    """How many images see the ground, on a coarse grid.

    Attributes
    ----------
    place : (k, 2) metres.  images : (k,) how many.  cell : (2,) sides of a cell.
    """

    place: Floats
    images: Ints
    cell: Floats

    def area(self, rays: int, detection: float) -> float:
        """Area in m², every part of it times the probability that enough images find a point there."""
        # Loaded late: half a second, for this one value of a simulation.
        from scipy import stats

        return float(np.sum(stats.binom.sf(rays - 1, self.images, detection)) * np.prod(self.cell))

    def around(self, least: int) -> Floats:
        """Upright rectangle (2, 2) around the ground that at least so many images see.

        Raises
        ------
        InconsistentBlockError : if there is none.
        """
        seen = self.place[self.images >= least]
        if len(seen) == 0:
            raise InconsistentBlockError(
                f"No ground is seen by {least} images: increase the overlaps or the number of exposures."
            )
        return np.stack([seen.min(axis=0) - 0.5 * self.cell, seen.max(axis=0) + 0.5 * self.cell])

    def within(self, least: int) -> Floats:
        """Upright rectangle (2, 2) inside the ground that at least so many images see.

        The rectangle around it gives up the side with the most uncovered cells until there is none: what
        remains is large, though not always the largest.
        """
        low, _ = self.around(least)
        seen = (self.images >= least).reshape(_COARSE, _COARSE)
        rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
        top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        origin = low - np.array([left, top]) * self.cell
        while not seen[top:bottom, left:right].all():
            part = seen[top:bottom, left:right]
            sides = [part[0].mean(), part[-1].mean(), part[:, 0].mean(), part[:, -1].mean()]
            worst = int(np.argmin(sides))
            top, bottom = top + (worst == 0), bottom - (worst == 1)
            left, right = left + (worst == 2), right - (worst == 3)
        return np.stack([origin + np.array(corner) * self.cell for corner in ((left, top), (right, bottom))])


def coverage(images: ImageGeometry, terrain: Terrain, frame: LocalFrame) -> Coverage:
    """Coverage of the ground around the exposures."""
    height = frame.height(images.projection_centre) - terrain.mean
    corner = np.hypot(*images.half_format.T) / images.interior[:, 0]
    tilt = np.arccos(np.clip(images.local_from_camera[:, 2, 2], -1.0, 1.0))
    farthest = np.tan(np.minimum(tilt + np.arctan(corner), _HORIZON))
    reach = float(np.max(np.where(tilt > _OBLIQUE, farthest, corner) * height))
    low = images.projection_centre[:, :2].min(axis=0) - reach
    high = images.projection_centre[:, :2].max(axis=0) + reach
    cell = (high - low) / _COARSE
    steps = (np.arange(_COARSE) + 0.5) / _COARSE
    place = np.stack(np.meshgrid(*(low + (high - low) * steps[:, None]).T), -1).reshape(-1, 2)
    _, point = visible_rays(images, raised(place, terrain.elevation(place), frame))
    return Coverage(place, np.bincount(point, minlength=len(place)).astype(np.int64), cell)


def jittered_grid(
    specification: PointSpecification, covered: Coverage, random: np.random.Generator
) -> Floats:
    """Plan positions (m, 2): one in each cell of a square grid, anywhere in the middle of the cell.

    Raises
    ------
    InconsistentBlockError : if hardly any point of the ground would be found in enough images.
    """
    area = covered.area(specification.rays, specification.detection)
    low, high = covered.around(specification.rays)
    if np.prod(high - low) > _MOST_TRIALS * area:
        raise InconsistentBlockError(
            f"Of {_MOST_TRIALS} points hardly one would be found in {specification.rays} images: increase "
            "the overlaps or the detection."
        )
    side = float(np.sqrt(area / specification.count))
    columns, rows = np.ceil((high - low) / side).astype(np.int64)
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2) + 0.5
    return np.asarray(low + side * (grid + random.uniform(-_JITTER, _JITTER, grid.shape)))
