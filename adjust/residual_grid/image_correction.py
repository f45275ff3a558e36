"""Corrections of measured image coordinates from fields over the format, one for each set of images.

A correction is added to what was measured and enters as the constant ``offset`` of the image points, so
the sub-area of an image point and the arguments of additional parameters stay those of the measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.residual_grid import root_mean_square


@dataclass(frozen=True, eq=False)
class CorrectionField:
    """Corrections of image coordinates over a format.

    Attributes
    ----------
    cells : the sub-areas.
    value : (k, 2) correction of each of them, metres; NaN where none is known: nothing is corrected there.
    """

    cells: FormatCells
    value: Floats

    @classmethod
    def zero(cls, cells: FormatCells) -> CorrectionField:
        """A field without corrections."""
        return cls(cells, np.full((cells.count, 2), np.nan))

    def plus(self, more: Floats) -> CorrectionField:
        """With further corrections (k, 2) added; NaN adds nothing."""
        known = np.isfinite(self.value) | np.isfinite(more)
        return replace(self, value=np.where(known, np.nan_to_num(self.value) + np.nan_to_num(more), np.nan))

    @property
    def rms(self) -> Floats:
        """(2,) root mean square over the cells in which something is known; NaN without any."""
        return root_mean_square(self.value)


def corrected(
    rays: ImagePoints,
    fields: Sequence[CorrectionField | None],
    grid_of_image: Ints,
    interpolation: Interpolation,
) -> ImagePoints:
    """The image points with the corrections of the fields in the place of any they had.

    Parameters
    ----------
    fields : of each of the g sets of images; None: their image points are not corrected.
    grid_of_image : (images,) index into them.
    """
    offset = np.zeros_like(rays.xy)
    of_ray = grid_of_image[rays.image]
    for number, field in enumerate(fields):
        if field is not None:
            rows = np.flatnonzero(of_ray == number)
            offset[rows] = field.cells.interpolate(field.value, rays.xy[rows], interpolation)
    return replace(rays, offset=offset)
