"""Cross-validation of corrections: found from one half of the images, judged by the other.

The halves are every second image of each set, in the order of the block, so both cover the area. The whole
block is adjusted with corrections that come from the residuals of one half only. At the same place of the
format the two have no image point in common; what connects them there through object points and
orientations is small. So a correction that describes the camera makes the mean residuals of the other half
smaller, and one that describes the noise of its own half makes them larger.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools
from adjust.residual_grid.image_sets import Fields, Grids, ImageSets
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.selection.readjustment import Readjusted


@dataclass(frozen=True)
class CrossStep:
    """The residuals of images that were not used in their correction, after a number of steps.

    Attributes
    ----------
    number : of steps; the last one may have been refused.
    mean_rms : root mean square of their mean residuals, weighted with the numbers of image points, metres.
    rms : root mean square of the residuals themselves, over their a-priori standard deviations.
    """

    number: int
    mean_rms: float
    rms: float


@dataclass(frozen=True, eq=False)
class ImageHalves:
    """Two iterations, each with corrections from one half of the images.

    Attributes
    ----------
    sets : set 2 i + h holds the images of half h of set i.
    fields : the corrections from the residuals of each half, of every set i.
    now : the adjustment of the block with the corrections of each half.
    """

    sets: ImageSets
    fields: tuple[Fields, Fields]
    now: tuple[Readjusted, Readjusted]

    @classmethod
    def of(cls, whole: ImageSets, fields: Fields, now: Readjusted) -> ImageHalves | None:
        """Both halves in their present state; None where no cell has enough image points of both."""
        half = np.zeros_like(whole.grid_of_image)
        for number in range(len(whole.cells)):
            own = np.flatnonzero(whole.grid_of_image == number)
            half[own] = np.arange(len(own)) % 2
        sets = replace(
            whole,
            cells=tuple(own for own in whole.cells for _ in range(2)),
            grid_of_image=2 * whole.grid_of_image + half,
        )
        if not any(_known_to_both(*pair).any() for pair in _pairs(sets.means(now))):
            return None
        return cls(sets, (fields, fields), (now, now))

    def following(self) -> ImageHalves:
        """After one more step of both."""
        first, second = (self._step(half) for half in (0, 1))
        return replace(self, fields=(first[0], second[0]), now=(first[1], second[1]))

    def _step(self, half: int) -> tuple[Fields, Readjusted]:
        """Corrections of all images from the means of one half, and the adjustment with them."""
        own = tuple(pair[half] for pair in _pairs(self.sets.means(self.now[half])))
        fields = self.sets.added(self.fields[half], own)
        of_halves = tuple(field for field in fields for _ in range(2))
        return fields, self.sets.adjusted(of_halves, self.now[half].state)

    def step(self, number: int) -> CrossStep:
        """Residuals of the images that were not used, each half in the adjustment of the other."""
        total = weight = squares = residuals = 0.0
        sets, rays = self.sets, self.sets.readjustment.image_points
        for half in (0, 1):
            others = sets.chosen & (sets.grid_of_image[rays.image] % 2 != half)[:, None]
            squares += float(np.sum((self.now[half].residual[others] / rays.sigma[others]) ** 2))
            residuals += int(others.sum())
            for pair in _pairs(sets.means(self.now[half])):
                other, known = pair[1 - half], _known_to_both(*pair)
                if other is not None:
                    total += float(np.sum(other.count[known] * other.mean[known] ** 2))
                    weight += float(np.sum(other.count[known]))
        return CrossStep(number, float(np.sqrt(total / weight)), float(np.sqrt(squares / residuals)))


def _pairs(grids: Grids) -> list[tuple[ResidualGrid | None, ResidualGrid | None]]:
    return list(zip(grids[::2], grids[1::2], strict=True))


def _known_to_both(one: ResidualGrid | None, other: ResidualGrid | None) -> Bools:
    """(k, 2) means for which both halves have enough residuals."""
    if one is None or other is None:
        return np.zeros(0, dtype=bool)
    return np.asarray(np.isfinite(one.mean) & np.isfinite(other.mean))
