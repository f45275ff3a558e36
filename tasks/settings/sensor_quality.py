"""Settings of the examination of a sensor: flat, dark and exposure series, and the limits of the protocol."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from tasks.settings.base import InputPath, InputPaths, Settings, trouble
from tasks.settings.coordinates import NotNegative, Positive, Whole, one_table_or_several

#: Most defect pixels, single and double columns of the two kinds of sensors: certificate of a DMC (2010).
PROTOCOL = {"pan": (1000, 50, 4), "multispectral": (36, 1, 0)}


class ExposureLevel(Settings):
    """Images with the same illumination and exposure."""

    exposure_ms: NotNegative
    """Exposure time, ms."""
    images: Annotated[tuple[InputPath, InputPath], Field()]
    """Two images, whose difference is noise alone."""


class SensorSettings(Settings):
    """Images of a sensor without a scene, and the limits they must meet."""

    kind: Literal["pan", "multispectral"]
    """Whose limits apply: panchromatic sensors may have 1000 defect pixels, 50 single and 4 double columns,
    multispectral ones 36, 1 and 0.
    """
    bright: InputPaths = ()
    """Flat images at about half the range."""
    dark: InputPaths = ()
    """Images without light."""
    bright_limit: Positive = 0.3
    """Deviation from its neighbours in bright images above which a pixel is defect."""
    dark_limit: Positive | None = None
    """The same in dark images, grey values. Default: 1 % of the largest grey value of the files; required
    where the sensor has fewer bits (12 of 16), or the files hold floating point.
    """
    column_pixels: Annotated[Whole, Field(ge=1)] = 12
    """Defect pixels that a column may have without being defective."""
    column_distance: Annotated[Whole, Field(ge=1)] = 3
    """Minimum distance of defect columns, columns."""
    series: Annotated[tuple[ExposureLevel, ...], BeforeValidator(one_table_or_several)] = ()
    """Exposure series, for linearity, sensitivity and photon transfer."""
    linearity_limit: Positive = 0.01
    """Largest residual of linearity that passes, as a fraction of the largest signal."""
    transfer_limit: Positive = 0.05
    """Largest residual of photon transfer that passes, as a fraction of the variance."""
    sensitivity_limit: Positive = 0.01
    """Largest relative σ of the sensitivity that passes."""
    aperture_limit: Positive = 0.02
    """Largest deviation of a cell of the format from the smooth fall-off of light that passes, as a fraction.
    """

    @model_validator(mode="after")
    def _complete(self) -> SensorSettings:
        if not (self.bright or self.dark or self.series):
            raise trouble("There is no image of the sensor.", "Name bright or dark images, or a series.")
        if self.series and not self.dark:
            raise trouble("A series requires the dark level.", "Also name dark images.")
        if self.series and len(self.series) < 3:
            raise trouble("A series of fewer than three exposures is not sufficient.", "Add further levels.")
        return self
