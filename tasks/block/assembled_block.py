"""From the delivered tables to a block with its observations, ready to be adjusted.

Parts of the observations may get standard deviations of their own, by file, camera and flight.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.quality.observation_parts import Division
from adjust.rig import Rig
from adjust.solve.system import Observations
from tasks.block.approximation import USED
from tasks.block.block_input import SurveyedPoints, block_of, image_point_observations, surveyed_points
from tasks.block.exposure_events import exposure_events
from tasks.block.given_orientations import GivenOrientations
from tasks.block.known_calibrations import (
    KnownCalibration,
    known_calibrations,
    with_joint_priors,
    with_known_calibrations,
)
from tasks.block.observation_types import Observed
from tasks.block.oriented_images import oriented_images
from tasks.block.own_observations import ObservedBlock, own_observations
from tasks.block.refracted_rays import without_refraction
from tasks.block.residual_grid import Fields, with_given_corrections
from tasks.block.self_calibration import BlockSelfCalibration, block_self_calibration
from tasks.block.strip_motion import require_motion
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_map
from tasks.files.in_turn import in_turn
from tasks.settings.adjustment import AdjustmentSettings
from tasks.store.artifact import Artifact
from tasks.tables.parquet import read_table


@dataclass(frozen=True, eq=False)
class DeliveredTables:
    """The tables an adjustment starts from: of the deliveries, and of the approximate values."""

    exposures: pd.DataFrame
    cameras: pd.DataFrame
    image_points: pd.DataFrame
    control_points: pd.DataFrame
    distances: pd.DataFrame
    approximate_points: pd.DataFrame
    approximate_boresight: pd.DataFrame
    approximate_orientations: pd.DataFrame

    @classmethod
    def of(cls, tables: Mapping[str, Artifact]) -> DeliveredTables:
        """The tables as they are stored, by the names of the attributes."""

        def of(name: str) -> pd.DataFrame:
            return read_table(tables[name], categories=name == "image_points")

        return cls(**dict(zip(tables, in_turn(of, tables, threads=2), strict=True)))


@dataclass(frozen=True, eq=False)
class BlockStart:
    """Where a block begins: images with their given orientations, object and surveyed points in one frame.

    Attributes
    ----------
    points : names of the object points that are used.
    x_in_local : (points, 3) approximate positions.
    rig, events : exposure events of a rig, and their orientations; None, and those of the images, of cameras
        alone.
    """

    frame: AdjustmentFrame
    given: GivenOrientations
    points: tuple[str, ...]
    x_in_local: Floats
    surveyed: SurveyedPoints
    rig: Rig | None
    events: GivenOrientations

    @classmethod
    def of(cls, delivered: DeliveredTables, map_frame: MapFrame) -> BlockStart:
        """Of the delivered tables and their approximate values.

        Raises
        ------
        InputError
            If no image is oriented, or heads cannot be combined into events.
        """
        approximate = delivered.approximate_points
        given, frame, _ = oriented_images(
            delivered.exposures,
            delivered.cameras,
            delivered.image_points,
            map_frame,
            delivered.approximate_orientations,
        )
        surveyed = surveyed_points(delivered.control_points, map_frame, frame, near=approximate)
        start = approximate[approximate["status"] == USED]
        x_in_local = local_from_map(map_frame, frame, start[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
        events = exposure_events(given)
        rig, of_events = (None, given) if events is None else (events.rig, events.given)
        return cls(frame, given, tuple(start["point"].tolist()), x_in_local, surveyed, rig, of_events)


@dataclass(frozen=True, eq=False)
class AssembledBlock:
    """A block with its observations, ready to be adjusted.

    Attributes
    ----------
    frames : of the map and of the adjustment.
    never_used : rows of the image points that are of no object point.
    cameras : cameras.parquet.
    fields : given residual grids.
    divisions : parts of the groups with standard deviations of their own.
    known : calibrations that are considered or observed.
    """

    frames: tuple[MapFrame, AdjustmentFrame]
    given: GivenOrientations
    block: Block
    observations: Observations
    surveyed: SurveyedPoints
    never_used: pd.DataFrame
    cameras: pd.DataFrame
    calibration: BlockSelfCalibration | None
    fields: Fields
    divisions: tuple[Division, ...]
    known: tuple[KnownCalibration, ...] = ()

    @property
    def lever_arms(self) -> tuple[tuple[str, ...], Floats]:
        """Names of the cameras, and their given lever arms."""
        return self.given.mountings.names, self.given.mountings.lever_arm


def assembled_block(
    delivered: DeliveredTables, map_frame: MapFrame, settings: AdjustmentSettings
) -> AssembledBlock:
    """The block of the delivered tables, with approximate values and all observations."""
    start, measured = BlockStart.of(delivered, map_frame), delivered.image_points
    frame, given, surveyed, of_events = start.frame, start.given, start.surveyed, start.events
    if "control" not in settings.observe:
        surveyed = replace(surveyed, is_check=np.ones_like(surveyed.is_check))
    calibration = block_self_calibration(given, delivered.cameras, settings.self_calibration)
    require_motion(of_events, settings)
    begin = of_events.with_boresight(delivered.approximate_boresight).orientations()
    block = block_of(frame, given, start.points, start.x_in_local, settings, calibration, begin, start.rig)
    known = known_calibrations(block, delivered.cameras)
    block = with_known_calibrations(block, known)
    rays, rows = _image_points(block, measured, settings, calibration)
    others = Observed(block, of_events, surveyed, delivered.distances, settings, calibration).groups()
    observed = ObservedBlock(block, lambda place: local_from_map(map_frame, frame, place))
    taken = [group.name for group in (rays, *others)]
    others += own_observations(observed, settings.own_observations, taken)
    observations = Observations(rays, with_joint_priors(block, others, known))
    rays, fields = with_given_corrections(observations.image_points, block, settings.residual_grid)
    never_used = np.ones(len(measured), dtype=bool)
    never_used[rows] = False
    return AssembledBlock(
        (map_frame, frame),
        given,
        block,
        replace(observations, image_points=rays),
        surveyed,
        measured[never_used],
        delivered.cameras,
        calibration,
        fields,
        divisions_of(observations, of_events, measured["input_file"], rows, settings),
        known,
    )


def _image_points(
    block: Block,
    measured: pd.DataFrame,
    settings: AdjustmentSettings,
    calibration: BlockSelfCalibration | None,
) -> tuple[ImagePoints, Ints]:
    """The image points of the block, and their rows in the table."""
    rays, rows = image_point_observations(
        measured,
        block.images,
        block.points,
        block.camera_of_image,
        calibration,
        None if block.rig is None else block.rig.event_of_image,
    )
    return (without_refraction(rays, block) if settings.refraction == "standard" else rays), rows


def divisions_of(
    observations: Observations,
    given: GivenOrientations,
    input_file: pd.Series,
    rows: Ints,
    settings: AdjustmentSettings,
) -> tuple[Division, ...]:
    """The divisions that the settings ask for, of groups that have more than one part.

    Parameters
    ----------
    input_file : names of the files of all image points that were delivered.
    rows : (n,) which of these the image points of the observations are.
    """
    if not settings.variance_components:
        return ()
    by = settings.variance_components_by
    rays = observations.image_points
    names = np.array(given.mountings.names, dtype=object)[rays.camera_of_image[rays.image]]
    labels = [
        *((input_file.to_numpy(dtype=object)[rows],) if "file" in by else ()),
        *((np.array([f"camera {name}" for name in names], dtype=object),) if "camera" in by else ()),
    ]
    return tuple(
        division
        for division in (
            *(_division(rays.name, together) for together in _joined(labels)),
            *(
                _division(group.name, np.array(given.flight, dtype=object)[group.event], "flight ")
                for group in observations.others
                if "flight" in by and isinstance(group, GnssPositions | InsAttitudes)
            ),
        )
        if len(division.names) > 1
    )


def _joined(labels: list[np.ndarray]) -> Iterator[np.ndarray]:
    """The labels (n,) of several kinds combined; None without any."""
    if labels:
        first, *others = labels
        for other in others:
            first = first + ", " + other
        yield first


def _division(group: str, label: np.ndarray, before: str = "") -> Division:
    index, names = pd.factorize(label, sort=True)
    return Division(group, tuple(f"{before}{name}" for name in names), index.astype(np.int64))
