"""Settings of the mean residuals of the images in sub-areas, and of their use as corrections."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tasks.settings.base import InputPaths, Settings
from tasks.settings.coordinates import Positive, Whole


class ResidualGridSettings(Settings):
    """Mean residuals of all images of a camera in sub-areas of the image."""

    cells: Annotated[Whole, Field(ge=1, le=100)] | None = None
    """Sub-areas along each side of the image. Default 25, or fewer, so that a sub-area has 25 image points on
    average. With `file`, those of the file. Seams between CCD images (`tiles` of the camera) are always
    borders.
    """
    file: InputPaths = ()
    """`residual_grid.parquet` of another run, such as the high flight of the same camera: its corrections
    (its mean residuals, if it applied none) are added to the image coordinates. Several are averaged, each
    mean weighted with the number of its residuals over their mean variance.
    """
    iterations: Annotated[Whole, Field(ge=0, le=50)] = 0
    """Maximum number of times that the mean residuals are added to the image coordinates and the block is
    adjusted again; 0: they are only computed. 3 to 5 iterations correct most of the error that remains after
    one. The standard deviations include what the corrections leave of image errors, up to 1,300 sub-areas.
    """
    cross_validation: bool = True
    """Whether every iteration is first tested with halves of the images. It is omitted if it does not reduce
    the mean residuals of the images that were not used for it.
    """
    smoothing: Literal["none", "gaussian", "counts", "collocation"] = "counts"
    """Smoothing of the means before they are added: `none`; `gaussian`; `counts`, a Gaussian in which each
    mean is weighted with its number of image points; `collocation` (least squares, determines its own width).
    No smoothing extends across a seam.
    """
    smoothing_width: Positive = 0.04
    """Standard deviation of the Gaussian as a fraction of the side of the image; 0.04 is one of 25 sub-areas.
    """
    interpolation: Literal["bilinear", "cell"] = "bilinear"
    """Correction of an image point: `bilinear` between the centres of the sub-areas, or constant in each
    `cell`.
    """
