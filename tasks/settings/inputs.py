"""Settings of the files a project reads: image points, exposures, control points."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from tasks.formats.register import (
    control_formats,
    distance_formats,
    exposure_formats,
    image_point_formats,
)
from tasks.settings.base import InputPath, Settings, one_of, trouble
from tasks.settings.coordinates import (
    Angles,
    Heights,
    NotNegativeTriple,
    PlacedSettings,
    Positive,
    PositivePair,
    PositiveTriple,
    one_table_or_several,
)
from tasks.settings.table_layout import Name, StripRule, TableSettings

#: Default standard deviation of an image point, in pixels: automatic tie points reach 1/4 to 1/3 px.
IMAGE_POINT_SIGMA_PX = 0.3


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names[1:])


class ImagePointsInput(TableSettings):
    """One file of image points: tie points, or measurements of control points."""

    file: InputPath = Field(description="The file.")
    format: Annotated[str, AfterValidator(one_of(image_point_formats, "format of image points"))] = Field(
        description="`csv` (image, point, x, y [, sx, sy]; headings of others can be declared) or another of "
        f"[the formats that are read](import.md): {_listed(image_point_formats())}."
    )
    unit: Literal["px", "mm", "um", "centred-px", "longer-side"] = Field(
        description="Unit of x and y: `px` are column and row, `mm` and `um` are in the image system "
        "(origin at the format centre, x along columns, y against rows), and so are `centred-px`, pixels, "
        "and `longer-side`, parts of the longer side of the image. Not guessed, because a wrong unit can "
        "look right."
    )
    image_names: InputPath | None = Field(
        default=None,
        description="Table (CSV with a line of headings) of the name of each image in this file and its name "
        "in the project, for formats that number images or cut their names: the `patb_images.csv` of an "
        "export.",
    )
    sigma: PositivePair | None = Field(
        default=None,
        description="Standard deviation of x and y in `unit`, one number or two. Default 0.3 px: automatic "
        "tie points reach 1/4 to 1/3 px, manual measurements 0.3 to 0.5 px. A row's sx, sy beat it.",
    )


class ExposureSigma(Settings):
    """Standard deviations of exposures that give none in their rows."""

    position_m: PositiveTriple = Field(
        default=(0.05, 0.05, 0.05),
        description="Position along east, north, up, m; one number or three. Default 0.05 m: differential "
        "GNSS reaches 2 to 10 cm.",
    )
    attitude_deg: PositiveTriple = Field(
        default=(0.003, 0.003, 0.008),
        description="Angles, degrees; one number or three in the order ω, φ, κ or roll, pitch, heading. "
        "Default 0.003, 0.003, 0.008: a good inertial system after smoothing.",
    )


class DeliveredFlight(Settings):
    """What is known of a flight besides what its exposures say."""

    part_of: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Flight it is a part of, such as one height of it: parts of one flight have one GNSS "
        "solution, and so one GNSS shift and time offset. With a shift of its own for each height no flight "
        "determines a focal length.",
    )
    camera: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Camera its exposures are of, in the place of the delivered one. After a remount or "
        "another focus: one more camera of the project file, with an interior orientation, boresight and "
        "lever arm of its own.",
    )


class ExposuresInput(PlacedSettings, TableSettings):
    """One file of exposures: GNSS/INS results or given orientations."""

    file: InputPath = Field(description="The file.")
    format: Annotated[str, AfterValidator(one_of(exposure_formats, "format of exposures"))] = Field(
        description="`csv` (image, camera, strip, x, y, z, omega, phi, kappa or heading, pitch, roll [, "
        "time, flight, sx, sy, sz, somega, sphi, skappa or sheading, spitch, sroll, rate_roll, rate_pitch, "
        "rate_yaw]; headings of others can be declared) or another of [the formats that are "
        f"read](import.md): {_listed(exposure_formats())}."
    )
    crs: str = Field(description='CRS of x and y, e.g. "EPSG:2154", or "local". x is east and y is north.')
    heights: Heights = Field(description='Height system of z; not needed with crs = "local".')
    position: Literal["projection_centre", "antenna", "imu"] = Field(
        description="What the position is of: `antenna`, or `imu`, the point to which `lever_arm_m` of the "
        "camera leads (one of both in a project); or `projection_centre`, if the delivery was reduced with "
        "that lever arm and its attitudes already, which is undone: a lever arm estimated is that of the "
        "antenna for both, and without `lever_arm_m` what the reduction left over."
    )
    angles: Angles = Field(description="What the three angles are.")
    sigma: ExposureSigma = Field(
        default_factory=ExposureSigma, description="Standard deviations; those of a row beat them."
    )
    image_names: InputPath | None = Field(
        default=None,
        description="Table (CSV with a line of headings) of the name of each image in this file and its name "
        "in the project, for formats that number images or cut their names: the `patb_images.csv` of an "
        "export.",
    )
    camera: Name | None = Field(
        default=None,
        description="Camera of all exposures of this file, whatever the file says; for files that name none, "
        "or call it otherwise than the project.",
    )
    flight: Name | None = Field(
        default=None, description="Flight of all exposures of this file, whatever the file says."
    )
    strip: StripRule | None = Field(
        default=None,
        description='How strips are found, in the place of those of the file: `strip = "time-gaps"` or '
        '`strip = { pattern = "{strip}_*" }`.',
    )
    flights: dict[str, DeliveredFlight] = Field(
        default_factory=dict,
        description='Single flights by their delivered names, e.g. `high = { part_of = "1" }` or '
        '`"day 2" = { camera = "UCE-80 remounted" }`.',
    )

    def _given_in_another_way(self) -> tuple[str, ...]:
        return tuple(name for name in ("camera", "strip") if getattr(self, name) is not None)


class ControlInput(PlacedSettings, TableSettings):
    """One file of control and check points."""

    file: InputPath = Field(description="The file.")
    format: Annotated[str, AfterValidator(one_of(control_formats, "format of control points"))] = Field(
        description="`csv` (point, x, y, z [, sx, sy, sz, role]; headings of others can be declared) or "
        f"another of [the formats that are read](import.md): {_listed(control_formats())}."
    )
    crs: str = Field(description='CRS of x and y, e.g. "EPSG:2154", or "local". x is east and y is north.')
    heights: Heights = Field(
        description="Height system of z; often another one than that of the exposures. Not needed with "
        'crs = "local".'
    )
    sigma_m: NotNegativeTriple = Field(
        default=(0.05, 0.05, 0.05),
        description="Standard deviation along east, north, up, m; one number or three. Default 0.05 m, "
        "surveyed by differential GNSS (a network solution reaches 0.02 m); 0 is fixed, to 0.1 mm. A row's "
        "sx, sy, sz beat it.",
    )
    role: Literal["control", "check"] = Field(
        default="control",
        description="Role of the points whose row gives none: a `check` point's coordinates never enter an "
        "adjustment.",
    )
    check_points: tuple[str, ...] = Field(
        default=(),
        description="Names of the points of this file that are check points, whatever their row says.",
    )


class DistancesInput(Settings):
    """One file of measured distances between object points: scale bars, tapes."""

    file: InputPath = Field(description="The file.")
    format: Annotated[str, AfterValidator(one_of(distance_formats, "format of distances"))] = Field(
        default="csv", description="`csv` (point, other_point, distance [, sigma, role])."
    )
    unit: Literal["m", "mm"] = Field(
        description="Unit of distances and σ. They are straight distances in space, neither horizontal nor "
        "reduced to a map."
    )
    sigma: Positive | None = Field(
        default=None,
        description="Standard deviation of a distance in `unit`; a row's sigma beats it. One of both is "
        "needed: scale bars are known to some 0.01 mm, taped distances to millimetres.",
    )
    role: Literal["control", "check"] = Field(
        default="control",
        description="Role of the distances whose row gives none: a `check` distance never enters an "
        "adjustment.",
    )


_AsTuple = BeforeValidator(one_table_or_several)
ImagePointsInputs: TypeAlias = Annotated[tuple[ImagePointsInput, ...], _AsTuple]
ExposuresInputs: TypeAlias = Annotated[tuple[ExposuresInput, ...], _AsTuple]
ControlInputs: TypeAlias = Annotated[tuple[ControlInput, ...], _AsTuple]
DistancesInputs: TypeAlias = Annotated[tuple[DistancesInput, ...], _AsTuple]


class Inputs(Settings):
    """The files a project reads; each kind is one table or an array of tables."""

    image_points: ImagePointsInputs = Field(
        default=(),
        description="Files of image points; may be left out where `calibration.adjusted` gives orientations "
        "to calibrate with in two steps.",
    )
    exposures: ExposuresInputs = Field(
        default=(),
        description="Files of exposures. Positions and angles may be left empty, and all of it left out: "
        "approximate values of what is not given are then taken from the image points.",
    )
    images_without_exposure: Literal["refuse", "orient"] = Field(
        default="refuse",
        description="What image points of an image are that no file of exposures names: a slip "
        "(`refuse`), or to be oriented by the image points alone (`orient`; always so without `exposures`).",
    )
    control: ControlInputs = Field(
        default=(), description="Files of control and check points; none is allowed (GNSS fixes the datum)."
    )
    distances: DistancesInputs = Field(
        default=(),
        description="Files of distances between object points, control and check. They give a block its "
        "scale that has neither control points nor positions.",
    )

    @model_validator(mode="after")
    def _one_lever_arm(self) -> Inputs:
        if {"antenna", "imu"} <= {item.position for item in self.exposures}:
            raise trouble(
                "Some exposures give the position of the antenna, others that of the IMU: one lever_arm_m "
                "cannot lead to both.",
                "Deliver one of them, or the projection centre.",
            )
        return self

    @property
    def orient_without_exposure(self) -> bool:
        """Whether images without exposure are oriented by their image points."""
        return not self.exposures or self.images_without_exposure == "orient"
