"""Settings of the files a project reads: image points, exposures, control points."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from tasks.formats.register import (
    CONTROL_FORMATS,
    DISTANCE_FORMATS,
    EXPOSURE_SOURCES,
    IMAGE_POINT_FORMATS,
    TRAJECTORY_FORMATS,
)
from tasks.settings.base import InputPath, Settings, one_of, trouble
from tasks.settings.coordinates import (
    Angles,
    Finite,
    Heights,
    NotNegativeTriple,
    PlacedSettings,
    Positive,
    PositivePair,
    PositiveTriple,
    one_table_or_several,
)
from tasks.settings.table_layout import Name, StripRule, TableSettings
from tasks.settings.trajectory import EventsInput, SolutionName, SolutionUse, TrajectoryInput

#: Default standard deviation of an image point, in pixels: automatic tie points reach 1/4 to 1/3 px.
IMAGE_POINT_SIGMA_PX = 0.3


#: Units of lengths on the ground.
LengthUnit: TypeAlias = Literal["m", "ft", "us-ft"]


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names[1:])


class ImagePointsInput(TableSettings):
    """One file of image points: tie points, or measurements of control points."""

    file: InputPath
    """The file."""
    format: Annotated[str, AfterValidator(one_of(IMAGE_POINT_FORMATS, "format of image points"))] = Field(
        description="`csv` (image, point, x, y [, sx, sy]; other headings can be declared) or another of "
        f"[the formats that are read](import.md): {_listed((*IMAGE_POINT_FORMATS.own,))}."
    )
    unit: Literal["px", "mm", "um", "centred-px", "longer-side"]
    """Unit of x and y: `px` are column and row, `mm` and `um` are in the image system (origin at the format
    centre, x along columns, y against rows), and so are `centred-px`, pixels, and `longer-side`, fractions of
    the longer side of the image. The unit is not guessed, because a wrong unit can look right.
    """
    image_names: InputPath | None = None
    """Table (CSV with a header line) of the name of each image in this file and its name in the project, for
    formats that number images or truncate their names, e.g. the `patb_images.csv` of an export.
    """
    sigma: PositivePair | None = None
    """Standard deviation of x and y in `unit`, one number or two. Default 0.3 px: automatic tie points reach
    1/4 to 1/3 px, manual measurements 0.3 to 0.5 px. The sx, sy of a row take precedence.
    """


class ExposureSigma(Settings):
    """Standard deviations of exposures without their own in the row."""

    position_m: PositiveTriple = (0.05, 0.05, 0.05)
    """Position along east, north, up, m; one number or three. Default 0.05 m: differential GNSS reaches 2 to
    10 cm.
    """
    attitude_deg: PositiveTriple = (0.003, 0.003, 0.008)
    """Angles, degrees; one number or three in the order ω, φ, κ or roll, pitch, heading. Default 0.003,
    0.003, 0.008: a good inertial system after smoothing.
    """


class DeliveredFlight(Settings):
    """Additional information about a flight."""

    part_of: Annotated[str, Field(min_length=1)] | None = None
    """Flight to which it belongs, for example as one of several heights. Parts of one flight have one GNSS
    solution, and so one GNSS shift and time offset. With a separate shift for each height, no flight
    determines a focal length.
    """
    camera: Annotated[str, Field(min_length=1)] | None = None
    """Camera of its exposures, instead of the delivered one. After a remount or refocusing, declare another
    camera in the project file, with its own interior orientation, boresight and lever arm.
    """


class LengthSettings(Settings):
    """Unit of the coordinates of an input that are not in metres."""

    length_unit: LengthUnit = "m"
    """Unit of x, y, z and their standard deviations in the file: `m`, `ft` (0.3048 m) or `us-ft` (1200/3937
    m). Longitude and latitude stay degrees.
    """
    height_unit: LengthUnit | None = None
    """Unit of z and its standard deviation, if it is not `length_unit`."""


class MapAdjustment(Settings):
    """How another program treated the map in which it adjusted orientations."""

    world: Literal["map-cartesian", "map-cartesian-curved"]
    """`map-cartesian`: map coordinates as if they were Cartesian; `map-cartesian-curved`: the same, with the
    curvature of the earth corrected ([kinds of programs](export.md#what-a-program-can-be-given)).
    """
    ground_m: Finite
    """Mean height of the ground, in the heights of this input, m."""


class ExposuresInput(PlacedSettings, LengthSettings, TableSettings):
    """One file of exposures: GNSS/INS results or given orientations."""

    file: InputPath
    """The file."""
    format: Annotated[str, AfterValidator(one_of(EXPOSURE_SOURCES, "format of exposures"))] = Field(
        description="`csv` (image, camera, strip, x, y, z, omega, phi, kappa or heading, pitch, roll [, "
        "time, flight, event, sx, sy, sz, somega, sphi, skappa or sheading, spitch, sroll, rate_roll, "
        "rate_pitch, rate_yaw]; other headings can be declared) or another of [the formats that are "
        f"read](import.md): {_listed((*EXPOSURE_SOURCES.own,))}."
    )
    crs: str
    """CRS of x and y, e.g. "EPSG:2154", or "local". x is east and y is north."""
    heights: Heights
    """Height system of z; not needed with crs = "local"."""
    position: Literal["projection_centre", "antenna", "imu"]
    """Point to which the positions refer. `antenna` or `imu`: the end point of the camera's `lever_arm_m`
    (only one of the two in a project). `projection_centre`: the delivery was already reduced with that lever
    arm and its attitudes; this is undone. An estimated lever arm is therefore that of the antenna in all
    cases; without `lever_arm_m`, it is the remaining error of the reduction.
    """
    angles: Angles
    """Definition of the three angles."""
    adjusted_in: MapAdjustment | None = None
    """For orientations that another program adjusted with map coordinates treated as Cartesian: they are
    converted to rigorous ones ([how](import.md#orientations-adjusted-in-a-map)).
    """
    sigma: ExposureSigma = Field(default_factory=ExposureSigma)
    """Standard deviations; those of a row take precedence."""
    image_names: InputPath | None = None
    """Table (CSV with a header line) of the name of each image in this file and its name in the project, for
    formats that number images or truncate their names, e.g. the `patb_images.csv` of an export.
    """
    rigs: tuple[InputPath, InputPath] | None = None
    """For `colmap`: the files `rigs` and `frames` of the same model, e.g. `["rigs.txt", "frames.txt"]`, which
    join the images of [heads](rigs.md) to events. Other formats have this in the file itself.
    """
    camera: Name | None = None
    """Camera of all exposures of this file, regardless of the file; for files that name no camera, or use
    another name than the project.
    """
    flight: Name | None = None
    """Flight of all exposures of this file, regardless of the file."""
    strip: StripRule | None = None
    """How strips are identified, instead of using those of the file: `strip = "time-gaps"` or `strip = {
    pattern = "{strip}_*" }`.
    """
    flights: dict[str, DeliveredFlight] = Field(default_factory=dict)
    """Settings of single flights, by their delivered names, e.g. `high = { part_of = "1" }` or `"day 2" = {
    camera = "UCE-80 remounted" }`.
    """
    trajectory: TrajectoryInput = Field(default_factory=TrajectoryInput)
    """For a trajectory: its clock and accuracy."""
    events: EventsInput | None = None
    """For a trajectory: the times of the exposures. Without them, each solution of an `rtklib` file is an
    exposure, called by its number from 1.
    """
    solutions: dict[SolutionName, SolutionUse] = Field(default_factory=dict)
    """Use of positions by the kind of their GNSS solution, of files that state it (`rtklib`, `dji-mrk`): a
    standard deviation in m instead of that of the file, one number or three, or `leave-out`. Example:
    `solutions = { float = 0.5, single = "leave-out" }`.
    """

    @model_validator(mode="after")
    def _of_a_map(self) -> ExposuresInput:
        if self.adjusted_in is None:
            return self
        if self.angles.order == "heading-pitch-roll" or self.angles.reference != "grid":
            raise trouble(
                "Orientations adjusted in a map (adjusted_in) are ω, φ, κ about its grid.",
                'Declare angles.reference = "grid" and their order, or leave adjusted_in out.',
            )
        if self.position != "projection_centre":
            raise trouble(
                "Orientations adjusted in a map (adjusted_in) cannot have positions of an antenna or IMU.",
                'Declare position = "projection_centre", or leave adjusted_in out.',
            )
        return self

    @model_validator(mode="after")
    def _rigs_of_colmap(self) -> ExposuresInput:
        if self.rigs is not None and self.format != "colmap":
            raise trouble(
                f"rigs are files of a COLMAP model, and the format is {self.format}.",
                "Leave them out: other formats have their rigs in the file itself.",
            )
        return self

    @model_validator(mode="after")
    def _complete_trajectory(self) -> ExposuresInput:
        if self.format not in TRAJECTORY_FORMATS:
            given = [name for name in ("trajectory", "events") if name in self.model_fields_set]
            if given:
                raise trouble(
                    f"{', '.join(given)} belong to a trajectory, and {self.format} is a format of exposures.",
                    f"Leave them out, or declare the format: {', '.join(TRAJECTORY_FORMATS)}.",
                )
            return self
        if self.format == "sbet" and self.events is None:
            raise trouble(
                "A trajectory requires the times of the exposures.",
                'Declare events = { file = "events.csv", time = "gps-week" }.',
            )
        if self.format == "sbet" and self.trajectory.time is None:
            raise trouble(
                "The clock of the trajectory is not declared, and an SBET does not state it.",
                'Declare e.g. trajectory = { time = "gps-week" }.',
            )
        if self.format != "sbet" and self.trajectory.time is not None:
            raise trouble("The file of the trajectory states its clock itself.", "Leave trajectory.time out.")
        return self

    def _given_in_another_way(self) -> tuple[str, ...]:
        return tuple(name for name in ("camera", "strip") if getattr(self, name) is not None)


class ControlInput(PlacedSettings, LengthSettings, TableSettings):
    """One file of control and check points."""

    file: InputPath
    """The file."""
    format: Annotated[str, AfterValidator(one_of(CONTROL_FORMATS, "format of control points"))] = Field(
        description="`csv` (point, x, y, z [, sx, sy, sz, role]; other headings can be declared) or "
        f"another of [the formats that are read](import.md): {_listed((*CONTROL_FORMATS.own,))}."
    )
    crs: str
    """CRS of x and y, e.g. "EPSG:2154", or "local". x is east and y is north."""
    heights: Heights
    """Height system of z; often different from that of the exposures. Not needed with crs = "local"."""
    sigma_m: NotNegativeTriple = (0.05, 0.05, 0.05)
    """Standard deviation along east, north, up, m; one number or three. Default 0.05 m, surveyed by
    differential GNSS (a network solution reaches 0.02 m); 0 means fixed, to 0.1 mm. The sx, sy, sz of a row
    take precedence.
    """
    role: Literal["control", "check"] = "control"
    """Role of points without a role in their row. The coordinates of a `check` point are never used in an
    adjustment.
    """
    check_points: tuple[str, ...] = ()
    """Names of the points of this file that are check points, regardless of their row."""


class DistancesInput(Settings):
    """One file of measured distances between object points: scale bars, tapes."""

    file: InputPath
    """The file."""
    format: Annotated[str, AfterValidator(one_of(DISTANCE_FORMATS, "format of distances"))] = "csv"
    """`csv` (point, other_point, distance [, sigma, role])."""
    unit: Literal["m", "mm"]
    """Unit of distances and σ. They are slope distances, reduced neither to the horizontal nor to a map."""
    sigma: Positive | None = None
    """Standard deviation of a distance in `unit`; the sigma of a row takes precedence. One of the two is
    required. Scale bars are known to about 0.01 mm, taped distances to millimetres.
    """
    role: Literal["control", "check"] = "control"
    """Role of distances without a role in their row. A `check` distance is never used in an adjustment."""


_AsTuple = BeforeValidator(one_table_or_several)
ImagePointsInputs: TypeAlias = Annotated[tuple[ImagePointsInput, ...], _AsTuple]
ExposuresInputs: TypeAlias = Annotated[tuple[ExposuresInput, ...], _AsTuple]
ControlInputs: TypeAlias = Annotated[tuple[ControlInput, ...], _AsTuple]
DistancesInputs: TypeAlias = Annotated[tuple[DistancesInput, ...], _AsTuple]


class Inputs(Settings):
    """The files a project reads; each kind is one table or an array of tables."""

    image_points: ImagePointsInputs = ()
    """Files of image points; optional if `calibration.adjusted` gives orientations for a two-step
    calibration.
    """
    fiducials: ImagePointsInputs = ()
    """Files of the fiducial marks measured in scanned film images, like files of image points, with the names
    of the marks in place of points. Their coordinates in the camera are the marks of the camera. An affine
    transformation of each image corrects its image points for scan and film deformation.
    """
    exposures: ExposuresInputs = ()
    """Files of exposures. Positions and angles may be empty, and the files may be left out; missing
    approximate values are then computed from the image points.
    """
    images_without_exposure: Literal["refuse", "orient"] = "refuse"
    """Treatment of images that have image points but no exposure: refused as a mistake (`refuse`), or
    oriented by their image points only (`orient`; always so without `exposures`).
    """
    control: ControlInputs = ()
    """Files of control and check points; optional (GNSS can fix the datum)."""
    distances: DistancesInputs = ()
    """Files of distances between object points, control and check. They define the scale of a block without
    control points and positions.
    """

    @model_validator(mode="after")
    def _one_lever_arm(self) -> Inputs:
        if {"antenna", "imu"} <= {item.position for item in self.exposures}:
            raise trouble(
                "Some exposures give the position of the antenna, others that of the IMU: one "
                "lever_arm_m cannot apply to both.",
                "Deliver one of them, or the projection centre.",
            )
        return self

    @property
    def orient_without_exposure(self) -> bool:
        """Whether images without exposure are oriented by their image points."""
        return not self.exposures or self.images_without_exposure == "orient"
