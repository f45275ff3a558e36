"""Settings of a simulation: SPEC.toml and the presets."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, Field, model_validator

from tasks.settings.adjustment import FreeParameter, ObservedGroup
from tasks.settings.base import Settings, trouble
from tasks.settings.burn_in import BurnInSettings
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.cameras import Pixels
from tasks.settings.coordinates import (
    LOCAL,
    Finite,
    NotNegative,
    NotNegativeTriple,
    Positive,
    Real,
    Triple,
    Whole,
    one_table_or_several,
)
from tasks.settings.quality import Gates
from tasks.settings.simulated_truth import (
    MOST_EXPOSURES,
    MOST_SURVEYED,
    Pair,
    Part,
    SimulatedNoise,
    SimulatedTruth,
    WrittenName,
)
from tasks.settings.sweep import SweepSettings

#: What a simulation may ask for at most; the largest blocks there are have 50,000 images, 4,000,000 points.
_MOST_POINTS = 20_000_000

Surveyed: TypeAlias = Annotated[Whole, Field(gt=0, le=MOST_SURVEYED)]


def _one_or_several(value: object) -> object:
    return (value,) if isinstance(value, int) else value


class SimulatedProject(Settings):
    """The project to be written."""

    name: str = Field(min_length=1)
    """Name of the project."""
    crs: str = LOCAL
    """CRS of the files: "local" (metric Cartesian), or a projected CRS such as "EPSG:25832"; then
    `latitude_deg` and `longitude_deg` give the position of the block.
    """
    latitude_deg: Annotated[Real, Field(gt=-90.0, lt=90.0)] | None = None
    """Latitude of the block's centre, degrees."""
    longitude_deg: Annotated[Real, Field(ge=-180.0, le=180.0)] | None = None
    """Longitude of the block's centre, degrees east."""
    angles: Literal["heading-pitch-roll", "omega-phi-kappa"] = "heading-pitch-roll"
    """Angles in exposures.csv."""
    free: tuple[FreeParameter, ...] | None = None
    """System parameters estimated by the project. Default: those whose true values differ from the stated
    ones.
    """
    observe: tuple[ObservedGroup, ...] | None = None
    """Observations used by the project in addition to the image points; default: all."""

    @model_validator(mode="after")
    def _has_a_place(self) -> SimulatedProject:
        placed = self.latitude_deg is not None and self.longitude_deg is not None
        if self.crs != LOCAL and not placed:
            raise trouble(
                f"The location of the block in {self.crs} is missing.",
                "Give latitude_deg and longitude_deg of its centre.",
            )
        if self.crs == LOCAL and (self.latitude_deg is not None or self.longitude_deg is not None):
            raise trouble(
                'A block with crs = "local" has no location on the earth.',
                "Remove latitude_deg and longitude_deg, or give a CRS.",
            )
        return self


class SimulatedCamera(Settings):
    """The camera according to its certificate."""

    name: WrittenName
    """Name of the camera."""
    columns: Pixels
    """Width of the image, px."""
    rows: Pixels
    """Height of the image, px."""
    pixel_um: Positive
    """Side of a (square) pixel, µm."""
    focal_length_mm: Positive
    """Principal distance c, mm."""
    principal_point_mm: Pair = (0.0, 0.0)
    """Principal point x, y, mm."""
    mount_deg: Literal[0, 90, 180, 270] = 0
    """κ_mount; 0: image x (columns) points forward."""


class PlannedCamera(SimulatedCamera):
    """The camera with which the lines are planned."""

    takes_pictures: bool = True
    """`false`: it stands for the platform of the heads, such as the virtual image composed of theirs, and
    takes no pictures.
    """


_SIDE = 110.0


class SimulatedFilm(Settings):
    """Film images: their deformation, their place in the scanner, and the fiducial marks of the camera."""

    fiducials_mm: dict[WrittenName, Pair] = Field(
        default={
            "1": (-_SIDE, -_SIDE), "2": (_SIDE, _SIDE), "3": (-_SIDE, _SIDE), "4": (_SIDE, -_SIDE),
            "5": (-_SIDE, 0.0), "6": (_SIDE, 0.0), "7": (0.0, _SIDE), "8": (0.0, -_SIDE),
        },
        min_length=3,
        description="Coordinates of the fiducial marks, as in the calibration report, mm.",
    )  # fmt: skip
    fiducial_um: Positive = 3.0
    """σ of a measured mark, µm."""
    shrinkage_ppm: Finite = 100.0
    """Shrinkage of the film, parts per million."""
    affine_ppm: NotNegative = 50.0
    """σ of the further affine deformation of each image (scales and shears), parts per million."""
    shift_mm: NotNegative = 0.2
    """σ of the displacement of each image in the scanner, mm."""


class SimulatedHead(SimulatedCamera):
    """A further head of a rig, `[[head]]` for each; the lines are planned with `[camera]`."""

    rotation_deg: Triple = (0.0, 0.0, 0.0)
    """Rotation relative to the camera, as stated in the project: roll, pitch, yaw, degrees. `[45, 0, 0]`
    looks to the left, `[0, 45, 0]` ahead.
    """
    position_m: Triple = (0.0, 0.0, 0.0)
    """Position relative to the camera, as stated in the project: forward, right, down, m."""
    rotation_change_deg: Triple = (0.0, 0.0, 0.0)
    """True minus stated rotation, degrees."""
    position_change_m: Triple = (0.0, 0.0, 0.0)
    """True minus stated position, m."""
    synchronisation_offset_s: Finite = 0.0
    """Delay of its exposure relative to the camera, as stated in the project, s."""
    synchronisation_offset_change_s: Finite = 0.0
    """True minus stated synchronisation offset, s."""


class FlightLines(Settings):
    """Parallel lines with the same settings; `[flight]` for one group, `[[flight]]` for each of several."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9.-]+$")
    """Prefix of the line number in strip names."""
    flight: WrittenName = "1"
    """Flight to which the lines belong."""
    height_m: Positive
    """Flying height above the mean terrain, m."""
    heading_deg: Finite
    """Heading of the first line, degrees clockwise from north."""
    lines: Annotated[Whole, Field(gt=0, le=MOST_EXPOSURES)] | None = None
    """Number of lines; default: the length of `exposures`."""
    exposures: Annotated[
        tuple[Annotated[Whole, Field(gt=0, le=MOST_EXPOSURES)], ...], BeforeValidator(_one_or_several)
    ]
    """Number of exposures of every line, or a list with one number for each line."""
    end_lap: Part = 0.6
    """End lap, 0 to 1."""
    side_lap: Part = 0.6
    """Side lap, 0 to 1."""
    base_m: Positive | None = None
    """Base, m; instead of `end_lap`."""
    spacing_m: Positive | None = None
    """Line spacing, m; instead of `side_lap`."""
    directions: Literal["single", "alternating", "both"] = "alternating"
    """`single`: all lines in the same direction; `alternating`: every second one reversed; `both`: every line
    forward and reverse.
    """
    centre_m: Pair = (0.0, 0.0)
    """Centre of the group: east, north, m."""
    start_m: Pair | None = None
    """First exposure of the first line, m; instead of `centre_m`."""
    speed_m_s: Positive = 75.0
    """Speed over ground, m/s."""

    @model_validator(mode="after")
    def _as_many_numbers_as_lines(self) -> FlightLines:
        if self.lines is not None and len(self.exposures) not in (1, self.lines):
            raise trouble(
                f"There are {self.lines} lines, but {len(self.exposures)} numbers of exposures.",
                "Give one number for all lines, or one for each.",
            )
        return self

    @property
    def exposures_in_all(self) -> int:
        """Number of exposures of all lines, those flown both ways counted twice."""
        alike = self.lines if self.lines is not None and len(self.exposures) == 1 else 1
        return alike * sum(self.exposures) * (2 if self.directions == "both" else 1)

    @property
    def exposures_of_lines(self) -> tuple[int, ...]:
        """Number of exposures of each line."""
        if self.lines is None or len(self.exposures) == self.lines:
            return self.exposures
        return self.exposures * self.lines


class SimulatedTrajectory(Settings):
    """Deviations of the flight from its plan."""

    position_m: NotNegativeTriple = (3.0, 3.0, 5.0)
    """σ of the flight about its plan: along, across, height, m."""
    attitude_deg: NotNegativeTriple = (1.0, 1.0, 0.5)
    """σ of roll, pitch, heading of an exposure, degrees."""
    crab_deg: NotNegative = 3.0
    """σ of the crab angle of a strip, degrees."""
    rate_deg_s: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the angular velocity of the body at an exposure about its axes forward, right, down, degrees per
    second. If not zero, the exposures are delivered with rates.
    """
    sbet_hz: Annotated[Real, Field(ge=1.0, le=1000.0)] | None = None
    """Deliver the exposures as trajectories and events instead of a table: for each flight an SBET with so
    many samples per second, its smrmsg, and the times of the exposures. Velocities and rates are then those
    of a smooth path through the exposures, with turns.
    """

    @model_validator(mode="after")
    def _one_kind_of_rates(self) -> SimulatedTrajectory:
        if self.sbet_hz is not None and any(self.rate_deg_s):
            raise trouble(
                "The rates of a trajectory (sbet_hz) follow from its path, but rate_deg_s is also given.",
                "Leave one of the two out.",
            )
        return self


class SimulatedTerrain(Settings):
    """The terrain: a sum of sines."""

    mean_m: Finite = 0.0
    """Mean elevation, m."""
    relief_m: NotNegative = 0.0
    """RMS of the elevations about it, m; 0: flat."""
    shortest_m: Positive = 400.0
    """Shortest wavelength, m."""
    longest_m: Positive = 3000.0
    """Longest wavelength, m."""


class SimulatedPoints(Settings):
    """Tie points."""

    count: Annotated[Whole, Field(gt=0, le=_MOST_POINTS)]
    """Expected number of tie points."""
    detection: Annotated[Real, Field(gt=0.0, le=1.0)] = 1.0
    """Probability that a point is measured in an image in which it is visible."""
    min_rays: Annotated[Whole, Field(ge=2, le=MOST_EXPOSURES)] = 2
    """Points with fewer rays are dropped."""
    margin: Part = 0.02
    """Fraction of the half format along the borders without measurements."""


class SimulatedControl(Settings):
    """Control and check points with the same layout; `[control]` for one set, `[[control]]` for several."""

    layout: Literal["grid", "perimeter", "spread", "list"]
    """`grid`: columns × rows; `perimeter`: evenly along the border of the covered area; `spread`: each as far
    as possible from the others; `list`: at `places_m`.
    """
    kind: Literal["full", "height", "plan"] = "full"
    """Which coordinates are known: all, the height, or x and y."""
    columns: Surveyed | None = None
    """Columns of a grid."""
    rows: Surveyed | None = None
    """Rows of a grid."""
    count: Surveyed | None = None
    """Number of points of `perimeter` and `spread`."""
    places_m: tuple[Pair, ...] = ()
    """East, north of the points of a list, m."""
    control: Annotated[Whole, Field(ge=0)] | None = None
    """Number of control points, chosen for the best distribution; the others are check points. Default: all,
    except `check_fraction`.
    """
    check_fraction: Annotated[Real, Field(ge=0.0, le=1.0)] = 0.0
    """Fraction of the points that are check points; instead of `control`."""
    margin: Part = 0.03
    """Fraction of the sides of the covered area left free along its borders."""
    extent_m: tuple[Positive, Positive] | None = None
    """Sides east, north of a rectangle about the origin in which the points lie, m; default: the covered
    area.
    """

    @model_validator(mode="after")
    def _complete(self) -> SimulatedControl:
        given = {
            "grid": self.columns is not None and self.rows is not None,
            "perimeter": self.count is not None,
            "spread": self.count is not None,
            "list": len(self.places_m) > 0,
        }
        if not given[self.layout]:
            needed = {"grid": "columns and rows", "list": "places_m"}.get(self.layout, "count")
            raise trouble(f"The layout '{self.layout}' needs {needed}.", f"Give {needed}.")
        if (self.columns or 0) * (self.rows or 0) > MOST_SURVEYED:
            raise trouble(
                f"The grid has {(self.columns or 0) * (self.rows or 0):,} points, more than "
                f"{MOST_SURVEYED:,}.",
                "Give fewer columns and rows.",
            )
        if self.control is not None and self.check_fraction > 0.0:
            raise trouble("`control` and `check_fraction` exclude each other.", "Keep one of the two.")
        return self


_AsTuple = BeforeValidator(one_table_or_several)


class Simulation(Settings):
    """A simulation: SPEC.toml, its preset filled in."""

    preset: str | None = None
    """The preset that supplies all values not given here."""
    seed: Annotated[Whole, Field(ge=0)] = 1
    """Seed of all random numbers."""
    project: SimulatedProject
    """The project to be written."""
    camera: PlannedCamera
    """The camera; of a rig the reference head."""
    head: Annotated[tuple[SimulatedHead, ...], BeforeValidator(one_table_or_several)] = ()
    """Further heads of a rig, exposed together with the camera."""
    flight: Annotated[tuple[FlightLines, ...], Field(min_length=1), _AsTuple]
    """Groups of parallel lines."""
    trajectory: SimulatedTrajectory = Field(default_factory=SimulatedTrajectory)
    """Deviations of the flight from its plan."""
    terrain: SimulatedTerrain = Field(default_factory=SimulatedTerrain)
    """The terrain."""
    points: SimulatedPoints
    """Tie points."""
    control: Annotated[tuple[SimulatedControl, ...], _AsTuple] = ()
    """Control and check points."""
    noise: SimulatedNoise
    """Noise and gross errors."""
    truth: SimulatedTruth = Field(default_factory=SimulatedTruth)
    """The true camera system."""
    film: SimulatedFilm | None = None
    """Film images with fiducial marks; default: digital images."""
    calibration: CalibrationSettings | None = None
    """The `[calibration]` of the project, as in docs/project-file.md."""
    burn_in: BurnInSettings | None = None
    """The `[burn_in]` of the project, as in docs/project-file.md."""
    gates: Gates | None = None
    """The `[gates]` of the project, as in docs/project-file.md."""
    sweep: SweepSettings | None = None
    """The `[sweep]` of the project, as in docs/project-file.md."""

    @model_validator(mode="after")
    def _of_a_size(self) -> Simulation:
        exposures = sum(lines.exposures_in_all for lines in self.flight)
        if exposures > MOST_EXPOSURES:
            raise trouble(
                f"The flight has {exposures:,} exposures, more than {MOST_EXPOSURES:,}.",
                "Give fewer lines or exposures.",
            )
        return self

    @model_validator(mode="after")
    def _true_focal_lengths(self) -> Simulation:
        for camera in (self.camera, *self.head):
            true = camera.focal_length_mm + self.truth.focal_length_change_mm
            if true <= 0.0:
                raise trouble(
                    f"The true focal length of {camera.name} would be {true:g} mm.",
                    "truth.focal_length_change_mm is the true minus the certified one, mm.",
                )
        return self

    @model_validator(mode="after")
    def _heads_differ(self) -> Simulation:
        names = [self.camera.name, *(head.name for head in self.head)]
        if len(set(names)) < len(names):
            raise trouble(
                f"Two heads of the rig have the same name ({', '.join(names)}).", "Give each its own name."
            )
        if not self.head and not self.camera.takes_pictures:
            raise trouble(
                "The camera takes no pictures, and there are no heads that do.", "Add heads (`[[head]]`)."
            )
        if self.head and self.trajectory.sbet_hz is not None:
            raise trouble("Trajectories (trajectory.sbet_hz) are not written for rigs.", "Leave sbet_hz out.")
        return self

    @model_validator(mode="after")
    def _trajectory_on_the_earth(self) -> Simulation:
        if self.trajectory.sbet_hz is None:
            return self
        if self.project.crs == LOCAL or self.project.latitude_deg is None:
            raise trouble(
                "An SBET (trajectory.sbet_hz) requires latitudes, but the project has no location on the "
                "earth.",
                "Give project.crs, latitude_deg and longitude_deg.",
            )
        if self.project.angles != "heading-pitch-roll":
            raise trouble(
                "An SBET (trajectory.sbet_hz) requires heading, pitch, roll.",
                'Give project.angles = "heading-pitch-roll".',
            )
        return self

    @model_validator(mode="after")
    def _sigma_of_the_angles(self) -> Simulation:
        if self.project.angles == "heading-pitch-roll":
            return self
        for name in ("ins_deg", "ins_markov_deg"):
            roll, pitch, _ = getattr(self.noise, name)
            if roll != pitch:
                raise trouble(
                    f"noise.{name} has different values of roll and pitch: the σ of ω and φ, which the "
                    "project states, would depend on the heading.",
                    'Give roll and pitch the same value, or project.angles = "heading-pitch-roll".',
                )
        return self

    @model_validator(mode="after")
    def _flights_exist(self) -> Simulation:
        flights = {lines.flight for lines in self.flight}
        for name in self.truth.gnss_shift_of_flight_m:
            if name not in flights:
                raise trouble(
                    f"A GNSS shift is given for flight '{name}', which does not exist.",
                    f"The flights are: {', '.join(sorted(flights))}.",
                )
        names = [lines.name for lines in self.flight]
        if len(set(names)) < len(names):
            raise trouble("Two groups of lines have the same name.", "Give each `[[flight]]` its own.")
        return self
