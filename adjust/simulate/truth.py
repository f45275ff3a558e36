"""The truth of a simulated block: everything before anybody measures with errors.

The chain: plan → trajectory → orientation of the cameras R_c = R_INS R_B(b) T → terrain and points →
which image sees which point → ideal image points → measured ones, with refraction and systematic image
errors. Nothing here knows the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.camera.refraction import refracted_image_points, refraction_coefficient
from adjust.geometry import rotation
from adjust.geometry.earth import CartesianFrame, LocalFrame
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, State
from adjust.rig import Rig
from adjust.simulate.flight_plan import FlightPlan, LineGroup, flight_plan
from adjust.simulate.flown_path import along_the_path
from adjust.simulate.gross_errors import GrossErrorSpecification
from adjust.simulate.heads import HeadSpecification, image_names, rig_of, true_heads
from adjust.simulate.image_errors import ImageErrors, ImageErrorSpecification, image_errors_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification, coverage, jittered_grid
from adjust.simulate.random_streams import RandomStreams, Source
from adjust.simulate.survey import SurveyLayout, survey_of
from adjust.simulate.system import SystemSpecification, true_system
from adjust.simulate.terrain import TerrainShape, raised, terrain_of
from adjust.simulate.trajectory import FlightVariation, Trajectory, fly
from adjust.simulate.visibility import ImageGeometry, visible_rays


@dataclass(frozen=True, eq=False)
class BlockSpecification:
    """A block to be simulated; all lengths in metres, angles in radians.

    Attributes
    ----------
    cameras : as certified.
    flight : groups of lines.
    points : the tie points.
    noise : standard deviations of the measurements.
    survey : control and check points.
    seed : of all random streams.
    frame : the local frame; heights are those of this frame.
    heads : heads of rigs next to the cameras that the lines are flown with.
    """

    cameras: tuple[FrameCamera, ...]
    flight: tuple[LineGroup, ...]
    points: PointSpecification
    noise: NoiseSpecification
    survey: tuple[SurveyLayout, ...] = ()
    variation: FlightVariation = field(default_factory=FlightVariation)
    terrain: TerrainShape = field(default_factory=TerrainShape)
    system: SystemSpecification = field(default_factory=SystemSpecification)
    image_errors: ImageErrorSpecification = field(default_factory=ImageErrorSpecification)
    gross_errors: GrossErrorSpecification = field(default_factory=GrossErrorSpecification)
    frame: LocalFrame = field(default_factory=CartesianFrame)
    seed: int = 1
    heads: tuple[HeadSpecification, ...] = ()


@dataclass(frozen=True, eq=False)
class BlockTruth:
    """A block without noise.

    Attributes
    ----------
    plan : the exposures by name, strip, flight, camera; those of a rig are events.
    trajectory : as flown.
    state : true values of all unknowns, with every family of system parameters.
    points : names of the m object points, ascending; surveyed points first.
    surveyed : (k,) indices of the surveyed points.  present : (k, 3) which of east, north, up are known.
    is_check : (k,).
    images, camera_of_image : names and cameras of the images; of a camera alone those of the exposures.
    image, point : (r,) of the rays, sorted by point, then image.
    xy : (r, 2) image coordinates as an errorless observer measures them, metres.
    image_errors : systematic errors of each camera.
    """

    plan: FlightPlan
    trajectory: Trajectory
    state: State
    points: tuple[str, ...]
    surveyed: Ints
    present: Bools
    is_check: Bools
    images: tuple[str, ...]
    camera_of_image: Ints
    image: Ints
    point: Ints
    xy: Floats
    image_errors: tuple[ImageErrors, ...]


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays (r,) of candidate points, with their measured image coordinates (r, 2)."""

    image: Ints
    point: Ints
    xy: Floats

    def only(self, kept: Bools) -> _Rays:
        return _Rays(self.image[kept], self.point[kept], self.xy[kept])


def block_truth(specification: BlockSpecification) -> BlockTruth:
    """The truth of a specification; the noise in it has no influence.

    Raises
    ------
    InconsistentBlockError : if the flight plan gives no block.
    """
    frame, streams = specification.frame, RandomStreams(specification.seed)
    plan = flight_plan(specification.flight)
    terrain = terrain_of(specification.terrain, streams.of(Source.TERRAIN))
    flown = fly(plan, specification.variation, terrain.mean, frame, streams.of(Source.TRAJECTORY))
    if specification.variation.is_path:
        flown = along_the_path(plan, flown)
    cameras = specification.cameras
    system = {
        **true_system(specification.system, cameras, plan, streams),
        **true_heads(specification.heads, len(cameras)),
    }
    local_from_camera = _local_from_camera(flown, plan, cameras, system)
    rig = rig_of(specification.heads, cameras, plan, flown)
    flight = State(flown.projection_centre, local_from_camera, np.zeros((0, 3)), system, rig)
    camera_of_image = plan.camera if rig is None else rig.camera_of_image
    geometry = _geometry(flight, camera_of_image, specification)

    covered = coverage(geometry, terrain, frame)
    survey = survey_of(specification.survey, covered.within(specification.points.rays))
    ties = jittered_grid(specification.points, covered, streams.of(Source.OBJECT_POINTS))
    place = np.concatenate([survey.place, ties])
    x_in_local = raised(place, terrain.elevation(place), frame)
    of_errors = streams.of(Source.IMAGE_ERRORS)  # one stream: every camera has its own directions
    errors = tuple(image_errors_of(specification.image_errors, camera, of_errors) for camera in cameras)
    rays = _measurable(geometry, camera_of_image, specification, x_in_local, errors)
    is_survey = np.arange(len(place)) < len(survey.place)
    rays = _detected(rays, is_survey, specification.points, streams.of(Source.DETECTION), rig)

    seen = np.unique(rays.point)
    surveyed = seen[is_survey[seen]]
    number = np.full(len(place), -1, dtype=np.int64)
    number[seen] = np.arange(len(seen))
    return BlockTruth(
        plan,
        flown,
        replace(flight, object_point=x_in_local[seen]),
        _names(len(surveyed), len(seen) - len(surveyed)),
        number[surveyed],
        survey.present[surveyed],
        survey.is_check[surveyed],
        plan.images if rig is None else image_names(rig, cameras),
        camera_of_image,
        rays.image,
        number[rays.point],
        rays.xy,
        errors,
    )


def _local_from_camera(
    flown: Trajectory, plan: FlightPlan, cameras: tuple[FrameCamera, ...], system: Mapping[str, Floats]
) -> Floats:
    """R_c = R_INS R_B(b) T of every exposure, (n, 3, 3)."""
    mounting = np.stack([camera.body_from_camera for camera in cameras])
    inertial_from_camera = rotation.from_roll_pitch_yaw(system[BORESIGHT]) @ mounting
    return np.asarray(flown.local_from_body @ inertial_from_camera[plan.camera])


def _geometry(flight: State, camera_of_image: Ints, specification: BlockSpecification) -> ImageGeometry:
    """What projects points into the images, with the margin taken off the formats."""
    half = np.array([camera.half_format for camera in specification.cameras])
    return ImageGeometry(
        flight.pictures.projection_centre,
        flight.pictures.local_from_camera,
        flight.system[INTERIOR_ORIENTATION][camera_of_image],
        ((1.0 - specification.points.margin) * half)[camera_of_image],
    )


def _measurable(
    geometry: ImageGeometry,
    camera_of_image: Ints,
    specification: BlockSpecification,
    x_in_local: Floats,
    errors: tuple[ImageErrors, ...],
) -> _Rays:
    """All rays with their measured coordinates, sorted by point, then image."""
    image, point = visible_rays(geometry, x_in_local)
    order = np.lexsort((image, point))
    image, point = image[order], point[order]
    interior = geometry.interior[image]
    ray = x_in_local[point] - geometry.projection_centre[image]
    p = np.einsum("nji,nj->ni", geometry.local_from_camera[image], ray)
    straight = interior[:, 1:] - interior[:, :1] * p[:, :2] / p[:, 2:]
    if specification.system.refraction:
        straight = _refracted(geometry, specification.frame, image, x_in_local[point], straight)
    ideal = straight - interior[:, 1:]
    measured, kept = np.empty_like(ideal), np.ones(len(ideal), dtype=bool)
    for number, of_camera in enumerate(errors):
        rows = camera_of_image[image] == number
        measured[rows], kept[rows] = of_camera.measured_from_ideal(ideal[rows])
    return _Rays(image, point, measured + interior[:, 1:]).only(kept)


def _refracted(
    geometry: ImageGeometry, frame: LocalFrame, image: Ints, x_in_local: Floats, straight: Floats
) -> Floats:
    """Image points (r, 2) after refraction, each with the height of its own object point."""
    camera_height = frame.height(geometry.projection_centre)
    up = np.asarray(frame.local_from_enu(geometry.projection_centre))[:, :, 2]
    coefficient = refraction_coefficient(camera_height[image], frame.height(x_in_local))
    return refracted_image_points(
        straight, geometry.interior[image], geometry.local_from_camera[image], up[image], coefficient
    )


def _detected(
    rays: _Rays,
    is_survey: Bools,
    specification: PointSpecification,
    random: np.random.Generator,
    rig: Rig | None,
) -> _Rays:
    """Rays that were found: surveyed points always, tie points with a probability; too few rays: none.

    The rays of several heads of one event count as one.
    """
    found = random.uniform(size=len(rays.image)) < specification.detection
    rays = rays.only(found | is_survey[rays.point])
    point = rays.point
    if rig is not None:
        point = np.unique(np.stack([rays.point, rig.event_of_image[rays.image]]), axis=1)[0]
    count = np.bincount(point, minlength=len(is_survey))
    return rays.only(count[rays.point] >= specification.rays)


def _names(surveyed: int, ties: int) -> tuple[str, ...]:
    """Names of surveyed points, C1 …, and tie points, T1 …, with zeros so that they sort by number."""
    of_survey, of_ties = max(3, len(str(surveyed))), max(5, len(str(ties)))
    return (
        *(f"C{number:0{of_survey}d}" for number in range(1, surveyed + 1)),
        *(f"T{number:0{of_ties}d}" for number in range(1, ties + 1)),
    )
