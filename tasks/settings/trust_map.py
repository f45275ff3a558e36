"""Settings of the trust map: how accurately a new point can be measured anywhere in the block."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tasks.settings.base import Settings
from tasks.settings.coordinates import Positive, Real


class TrustMapSettings(Settings):
    """Accuracy and reliability of newly measured points, cell by cell; an empty table turns it on."""

    cell_m: Positive | None = None
    """Side of the cells, m. Default: a hundredth of the longer side of the block, rounded down to 1, 2 or 5
    times a power of ten.
    """
    area_m: Annotated[tuple[tuple[Real, Real], ...], Field(min_length=3)] | None = None
    """Corners of the area to be mapped, east and north in the CRS, m. Cells in it that fewer than two images
    see, or without object points around, count as beyond every limit. Default: all cells between the object
    points that two images see.
    """
    sigma_image_um: Positive | None = None
    """Standard deviation of an image coordinate of a new point, µm. Default: the median of the block's own
    image points, times σ0.
    """
    share: Annotated[Real, Field(gt=0.0, le=1.0)] = 0.95
    """Fraction of the area on which the gates `trust_map_…` must be met; with 0.95, the worst 5 % may exceed
    them.
    """
