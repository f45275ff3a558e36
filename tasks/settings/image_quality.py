"""Settings of image quality: which images are examined, what is known of them, and limits of the protocol."""

from __future__ import annotations

from datetime import date
from math import hypot
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from tasks.plain_text import LONGEST_NAME
from tasks.settings.base import InputPath, InputPaths, Settings, trouble
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.coordinates import NotNegative, Positive, Real, Whole, one_table_or_several

#: Most defect pixels, single and double columns of the two kinds of sensors: certificate of a DMC (2010).
PROTOCOL = {"pan": (1000, 50, 4), "multispectral": (36, 1, 0)}
#: Length of an edge at least, px.
SHORTEST_EDGE = 20
#: What is read of the results of an earlier date.
EARLIER = "manifest.json"


class MotionSettings(Settings):
    """Exposure time and compensation; rates and velocities are those of the exposures of the project."""

    exposure_ms: Positive
    """Exposure time of the images, ms."""
    sigma_exposure_ms: NotNegative = 0.0
    """Its standard deviation, ms."""
    forward_motion: bool
    """Whether the images hold the movement of the flight: `false` for a camera that compensates it (time
    delay integration, moved sensor).
    """
    height_above_ground_m: Positive | None = None
    """Mean height above the ground, m; needed where the forward motion is seen."""
    sigma_rate_deg_s: Positive = 0.01
    """Standard deviation of the angular velocities of the exposures, °/s."""

    @model_validator(mode="after")
    def _height_for_forward_motion(self) -> MotionSettings:
        if self.forward_motion and self.height_above_ground_m is None:
            raise trouble(
                "The forward motion is seen, and the height above the ground is not given.",
                "Give height_above_ground_m.",
            )
        return self


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


class EarlierResults(Settings):
    """Results of an earlier date."""

    manifest: InputPath | None = None
    """Their manifest, which contains all digests."""


class ImageQualitySettings(Settings):
    """Resolution, noise and defects of the images of one camera."""

    outside_key: ClassVar[frozenset[str]] = frozenset({"name"})

    name: str = Field(default="Image quality", min_length=1, max_length=LONGEST_NAME)
    """Title of the report."""
    camera: str | None = Field(default=None, min_length=1, max_length=LONGEST_NAME)
    """Type and serial number of the camera, for the certificate. Default: `name`."""
    identity: CameraIdentity | None = None
    """Serial numbers of the camera, as in `cameras.NAME.identity`, for certificate and registry. Default:
    those of the camera of the project that `camera` names.
    """
    examined: date | None = None
    """Date of the images, e.g. 2026-09-21, for the certificate."""
    images: InputPaths = ()
    """Images of scenes, whose edges and homogeneous areas are examined: one path or a list. All must have the
    same size and bands.
    """
    bands: tuple[Annotated[Whole, Field(ge=1)], ...] = ()
    """Numbers of the bands of scenes that are examined, from 1. Default: all."""
    factor_max: Positive | None = None
    """Largest factor of effective resolution of a band that passes; a larger one, or none, ends with exit
    code 4. Default: not tested.
    """
    fail_on: tuple[Literal["sharpened", "drift", "motion"], ...] = ()
    """Findings that end with exit code 4: sharpened bands, a change since the earlier results, a smear that
    contradicts the trajectory. Default: they are remarks.
    """
    gsd_m: Positive | None = None
    """Ground sampling distance of the images, m, for the effective one. Default: not stated."""

    points_px: tuple[tuple[Real, Real], ...] = ()
    """Columns and rows (the centre of the first pixel is 0, 0) near which edges are searched for, within 40
    px, instead of everywhere. Only with one image.
    """
    edges_px: tuple[tuple[Real, Real, Real, Real], ...] = ()
    """Edges that are measured: column and row of one end, and of the other. Only with one image."""
    earlier: InputPath | None = None
    """Results of an earlier date for comparison: their folder. Default: none."""
    motion: MotionSettings | None = None
    """Movement of the images during their exposure, for comparison with the smear of their edges. Only in a
    project file, whose exposures have angular velocities. Default: none.
    """
    sensor: SensorSettings | None = None
    """Images of the sensor without a scene. Default: none."""

    @field_validator("earlier", mode="before")
    @classmethod
    def _manifest_of_folder(cls, value: object) -> object:
        is_folder = isinstance(value, str) and not value.endswith(EARLIER)
        return f"{value}/{EARLIER}" if is_folder else value

    @model_validator(mode="after")
    def _something_to_examine(self) -> ImageQualitySettings:
        if not self.images and self.sensor is None:
            raise trouble("There is no image to examine.", "Name one in image_quality.images.")
        if (self.points_px or self.edges_px) and len(self.images) != 1:
            raise trouble("Points and edges are given, which are those of one image.", "Name one image.")
        lacking = {"drift": self.earlier, "motion": self.motion}
        for name in self.fail_on:
            if name in lacking and lacking[name] is None:
                raise trouble(
                    f"A finding of '{name}' is to fail, but there is nothing to compare.",
                    "Give image_quality.earlier." if name == "drift" else "Give image_quality.motion.",
                )
        if self.motion is not None and not self.images:
            raise trouble("A movement is given, but no image of a scene.", "Name images.")
        short = [
            ends for ends in self.edges_px if hypot(ends[2] - ends[0], ends[3] - ends[1]) < SHORTEST_EDGE
        ]
        if short:
            raise trouble(
                f"The edge {list(short[0])} is short.", f"Give edges of at least {SHORTEST_EDGE} px."
            )
        names = [path.name for path in self.images]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise trouble(f"Two images have the name {twice[0]}.", "Give them different names.")
        return self

    def of_scenes(self) -> ImageQualitySettings:
        """The settings of the scenes alone, which do not depend on the others."""
        others = ("sensor", "earlier", "motion", "camera", "identity", "examined", "factor_max")
        return self.model_copy(update={**dict.fromkeys(others), "fail_on": ()})

    def earlier_alone(self) -> EarlierResults:
        """Nothing but the earlier results."""
        return EarlierResults(manifest=self.earlier)


class ImageQualityFile(Settings):
    """A file that describes nothing but images to be examined."""

    version: Literal[1]
    """Version of the file, 1."""
    image_quality: ImageQualitySettings
    """The images."""
