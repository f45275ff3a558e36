"""Settings of the mean residuals of the images in sub-areas, and of their use as corrections."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from tasks.settings.base import InputPaths, Settings, trouble
from tasks.settings.coordinates import Positive, Whole

#: Sub-areas along each side that collocation can have, for its matrices.
MOST_COLLOCATED = 36


class ResidualGridSettings(Settings):
    """Mean residuals of all images of a camera in sub-areas of the image."""

    cells: Annotated[Whole, Field(ge=1, le=100)] | None = None
    """Sub-areas along each side of the image. Default 25, or fewer: a sub-area has 25 image points on
    average, and with the method `collocation` several cameras have at most 700 sub-areas together. A camera
    in `file` always has those of the file. Seams between CCD images (`tiles` of the camera) are always
    borders.
    """
    file: InputPaths = ()
    """`residual_grid.parquet` of another run, such as the high flight of the same camera: its corrections
    (its mean residuals, if it applied none) are added to the image coordinates. Several are averaged, each
    mean weighted with the number of its residuals over their mean variance.
    """
    iterations: Annotated[Whole, Field(ge=0, le=50)] = 0
    """Maximum number of times that the image coordinates are corrected and the block is adjusted again; 0:
    mean residuals are only computed. 3 to 5 iterations are usual. The standard deviations include what the
    corrections leave of image errors, up to 1,300 sub-areas.
    """
    method: Literal["means", "collocation"] = "means"
    """How corrections follow from the mean residuals. `means`: the means are added. `collocation`: the most
    probable image errors are estimated through the normal equations, including what orientations and object
    points have absorbed of them. The latter is much more accurate where control and GNSS are sparse; it needs
    at most 36 `cells` and no `file`.
    """
    cross_validation: bool = True
    """Whether corrections are first tested with halves of the images. They are omitted if they do not reduce
    the mean residuals of the images that were not used for them.
    """
    smoothing: Literal["none", "gaussian", "counts", "collocation"] = "counts"
    """Smoothing of the means before they are added, with the method `means`: `none`; `gaussian`; `counts`, a
    Gaussian in which each mean is weighted with its number of image points; `collocation` (least squares,
    determines its own width). No smoothing extends across a seam.
    """
    smoothing_width: Positive = 0.04
    """Standard deviation of the Gaussian as a fraction of the side of the image; 0.04 is one of 25 sub-areas.
    """
    interpolation: Literal["bilinear", "cell"] = "bilinear"
    """Correction of an image point: `bilinear` between the centres of the sub-areas, or constant in each
    `cell`.
    """

    @model_validator(mode="after")
    def _collocation_is_possible(self) -> ResidualGridSettings:
        if self.method != "collocation":
            return self
        if self.iterations == 0:
            raise trouble(
                "The method `collocation` corrects nothing with 0 iterations.",
                "Set `iterations`, for instance to 5, or leave out `method`.",
            )
        if self.file:
            raise trouble(
                "The method `collocation` determines all corrections from this block; those of `file` would "
                "be lost.",
                "Leave out `file`, or set `method` to `means`.",
            )
        if self.cells is not None and self.cells > MOST_COLLOCATED:
            raise trouble(
                f"{self.cells} × {self.cells} sub-areas are too many for the method `collocation`.",
                f"Set `cells` to at most {MOST_COLLOCATED}.",
            )
        return self
