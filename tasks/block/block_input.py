"""From tables to a block and its image points; other observations: `tasks.block.observation_types`.

Text keys become indices here; degrees, millimetres and map coordinates become radians, metres and
the local frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints, order_of_numbers
from adjust.block import Block
from adjust.observations.image_point import ImagePoints
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    SystemParameters,
)
from adjust.rig import OF_HEADS, RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET, Rig
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.block.self_calibration import BlockSelfCalibration
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_map
from tasks.errors import InputError
from tasks.quantities import KINDS, Kind
from tasks.settings.adjustment import AdjustmentSettings
from tasks.tables.number_columns import numbers_of
from tasks.tables.places import places_of


@dataclass(frozen=True, eq=False)
class SurveyedPoints:
    """Control and check points in local terms.

    Attributes
    ----------
    name : names of the k points.
    is_check : (k,) whether the coordinates stay out of the adjustment.
    x_in_local : (k, 3) metres, NaN for a point whose plan position is not known.
    height : (k,) height above the ellipsoid (or the z of a local project), NaN if not known.
    covariance : (k, 3, 3) along east, north, up at the point, m².
    present : (k, 3) which of the three are known.
    """

    name: tuple[str, ...]
    is_check: Bools
    x_in_local: Floats
    height: Floats
    covariance: Floats
    present: Bools

    @property
    def complete(self) -> Bools:
        """(k,) whether all three coordinates are known."""
        return np.asarray(self.present.all(axis=1))

    def places_of_points(self, points: tuple[str, ...]) -> Floats:
        """Positions (m, 3) of object points, local frame, metres; NaN where a coordinate is not known."""
        place, row = np.full((len(points), 3), np.nan), places_of(self.name, points)
        known = np.flatnonzero((row >= 0) & self.complete)
        place[row[known]] = self.x_in_local[known]
        return place

    def control_among(self, points: tuple[str, ...]) -> tuple[Ints, Ints]:
        """Rows of the control points that are among object points, and their places there."""
        place = places_of(self.name, points)
        rows = np.flatnonzero((place >= 0) & ~self.is_check & self.present.any(axis=1))
        return rows, place[rows]


def surveyed_points(
    table: pd.DataFrame, map_frame: MapFrame, frame: AdjustmentFrame, near: pd.DataFrame | None = None
) -> SurveyedPoints:
    """Control and check points of control_points.parquet.

    Parameters
    ----------
    near : approximate_points.parquet; gives the plan position at which the geoid undulation of a point
        known in height only is taken (its slope of 5e-5 makes metres of it irrelevant).
    """
    given = numbers_of(table, ["x_m", "y_m", "z_m"])
    present = np.isfinite(given)
    place = given.copy()
    if near is not None and len(near):
        row = places_of(table["point"], near["point"])
        intersected = near[["x_m", "y_m", "z_m"]].to_numpy(np.float64)[row]
        known = (row >= 0)[:, None]
        place = np.where(np.isfinite(place) | ~known, place, intersected)
    usable = np.isfinite(place[:, :2]).all(axis=1)
    # A point without height gets any: its vertical is what counts.
    place[:, 2] = np.where(np.isfinite(place[:, 2]), place[:, 2], 0.0)
    x_in_local = np.full_like(place, np.nan)
    height = np.full(len(place), np.nan)
    covariance = np.zeros((len(place), 3, 3))
    sigma = numbers_of(table, ["sigma_x_m", "sigma_y_m", "sigma_z_m"])
    if usable.any():
        x_in_local[usable] = local_from_map(map_frame, frame, place[usable])
        height[usable] = frame.height(x_in_local[usable])
        convergence = np.zeros(len(place))
        convergence[usable] = map_frame.convergence(place[usable])
        covariance = _turned(np.where(present, sigma, 1.0), convergence)
    height[~present[:, 2]] = np.nan
    x_in_local[~present[:, :2].all(axis=1)] = np.nan
    return SurveyedPoints(
        tuple(table["point"]),
        (table["role"] == "check").to_numpy(),
        x_in_local,
        height,
        covariance,
        present,
    )


def _turned(sigma: Floats, convergence: Floats) -> Floats:
    """Covariances (k, 3, 3) in true east, north, up of standard deviations along the grid axes.

    Grid axes are turned by the convergence γ: east_true = cos γ east_grid + sin γ north_grid.
    """
    variance = sigma**2
    covariance = np.zeros((len(sigma), 3, 3))
    cosine, sine = np.cos(convergence), np.sin(convergence)
    covariance[:, 0, 0] = cosine**2 * variance[:, 0] + sine**2 * variance[:, 1]
    covariance[:, 1, 1] = sine**2 * variance[:, 0] + cosine**2 * variance[:, 1]
    covariance[:, 0, 1] = covariance[:, 1, 0] = cosine * sine * (variance[:, 1] - variance[:, 0])
    covariance[:, 2, 2] = variance[:, 2]
    return covariance


def control_distances(table: pd.DataFrame, points: tuple[str, ...]) -> tuple[pd.DataFrame, Ints]:
    """Rows of the control distances between these points, and the places (n, 2) of both ends."""
    own = table[table["role"] == "control"]
    ends = np.stack([places_of(own[name], points) for name in ("point", "other_point")], axis=1)
    kept = (ends >= 0).all(axis=1)
    return own.iloc[np.flatnonzero(kept)], ends[kept]


def image_point_observations(
    table: pd.DataFrame,
    images: tuple[str, ...],
    points: tuple[str, ...],
    camera_of_image: Ints,
    calibration: BlockSelfCalibration | None = None,
    event_of_image: Ints | None = None,
) -> tuple[ImagePoints, Ints]:
    """Image points of the given images and points, sorted by point, and their rows in the table."""
    image, point = places_of(table["image"], images), places_of(table["point"], points)
    rows = np.flatnonzero((image >= 0) & (point >= 0))
    rows = rows[order_of_numbers(image[rows], point[rows])]
    observations = ImagePoints(
        image[rows],
        point[rows],
        camera_of_image,
        table[["x_mm", "y_mm"]].to_numpy(np.float64)[rows] * 1e-3,
        table[["sigma_x_mm", "sigma_y_mm"]].to_numpy(np.float64)[rows] * 1e-3,
        np.ones(len(rows), dtype=bool),
        None if calibration is None else calibration.model,
        event_of_image=event_of_image,
    )
    return observations, rows


def stated_values(mountings: Mountings) -> dict[str, Floats]:
    """Family → the values (cameras, k) of its parameters that cameras and mountings state."""
    return {
        INTERIOR_ORIENTATION: np.array([[c.focal_length, *c.principal_point] for c in mountings.cameras]),
        BORESIGHT: mountings.boresight,
        LEVER_ARM: mountings.lever_arm,
        RELATIVE_POSITION: mountings.relative_position,
        RELATIVE_ROTATION: mountings.relative_rotation,
        SYNCHRONISATION_OFFSET: mountings.synchronisation_offset,
    }


def system_parameters(given: GivenOrientations, settings: AdjustmentSettings) -> tuple[SystemParameters, ...]:
    """All families with their given values; free are those the settings name.

    The values of mountings are given, all others are zero; what is not `always_there` is there only when it
    is free: nothing is known of it.
    """
    mountings, stated = given.mountings, stated_values(given.mountings)
    entities = {"camera": mountings.names, "flight": given.flights, "strip": given.strips}
    chosen = [KINDS[name] for name in settings.free]
    if not mountings.has_heads:
        refuse_heads(chosen)
    known = settings.priors.relative_position_m or settings.priors.synchronisation_offset_s
    if {"relative_position", "synchronisation_offset"} <= set(settings.free) and known is None:
        raise InputError(
            "The relative position along the flight and the synchronisation offset of a head cannot be "
            "separated at constant speed.",
            "Give adjustment.priors.relative_position_m or adjustment.priors.synchronisation_offset_s, "
            "or remove one of the two from `free`.",
        )
    values = {
        name: stated.get(name, np.zeros((len(entities[family.entity_kind]), len(family.components))))
        for name, family in FAMILIES.items()
        if family.always_there
        or any(kind.family == name for kind in chosen)
        or (mountings.has_heads and name in OF_HEADS)
    }
    free = {name: np.zeros(array.shape, dtype=bool) for name, array in values.items()}
    for one in chosen:
        free[one.family][:, one.components] = True
    is_reference = mountings.reference == np.arange(len(mountings.reference))
    _refuse_platform_and_heads(given, settings)
    for name in free:
        if name in OF_HEADS:
            free[name][is_reference] = False
        elif name in (BORESIGHT, LEVER_ARM):  # those of a head follow
            free[name][~is_reference] = False
    if INTERIOR_ORIENTATION in free:  # a platform that stands for its heads takes no image
        free[INTERIOR_ORIENTATION][np.setdiff1d(np.arange(len(mountings.names)), given.camera)] = False
    # A flight or strip all of whose images were oriented without GNSS or INS has nothing to shift.
    for kind, index in (("flight", given.flight_of_image), ("strip", given.strip_of_image)):
        for name in free:
            seen = given.attitude_observed if name in (INS_STRIP_BIAS, INS_DRIFT) else given.position_observed
            if FAMILIES[name].entity_kind == kind and seen.any():
                free[name][np.setdiff1d(index, index[seen])] = False
    return tuple(
        SystemParameters(FAMILIES[name], entities[FAMILIES[name].entity_kind], array, free[name])
        for name, array in values.items()
    )


def refuse_heads(chosen: Iterable[Kind]) -> None:
    """Refuse to estimate mountings of heads where no camera is a head of a rig.

    Raises
    ------
    InputError
        If one of the chosen kinds of parameters is of heads.
    """
    if any(kind.family in OF_HEADS for kind in chosen):
        raise InputError(
            "Relative positions, rotations and synchronisation offsets are of the heads of a rig, but no "
            "camera is a head.",
            "Remove relative_position, relative_rotation and synchronisation_offset from `free`.",
        )


def _refuse_platform_and_heads(given: GivenOrientations, settings: AdjustmentSettings) -> None:
    """Refuse to estimate both a platform without images of its own and its heads: its pose follows from them.

    Likewise the rotations of its heads where no INS observes it. Known positions of the heads hide both:
    pivots look sound.
    """
    mountings, free = given.mountings, set(settings.free)
    silent = np.setdiff1d(mountings.reference[given.camera], given.camera)
    for own, of_heads in (("boresight", "relative_rotation"), ("lever_arm", "relative_position")):
        known = getattr(settings.priors, f"{of_heads}_{'deg' if own == 'boresight' else 'm'}")
        if len(silent) and {own, of_heads} <= free and known is None:
            raise InputError(
                f"The platform takes no pictures: its {own} and the {of_heads} of all its heads are one and "
                "the same.",
                f"Take {own} out of `free`; the heads' values contain it.",
                entity=f"camera {mountings.names[silent[0]]}",
            )
    of_silent = np.isin(mountings.reference[given.camera], silent)
    observed = "ins" in settings.observe and bool((given.attitude_observed & of_silent).any())
    known = settings.priors.relative_rotation_deg
    if len(silent) and "relative_rotation" in free and not observed and known is None:
        raise InputError(
            "The platform takes no pictures and no INS observes its attitude, so a common rotation of all "
            "its heads is not determined.",
            "Give adjustment.priors.relative_rotation_deg, or remove relative_rotation from `free`.",
            entity=f"camera {mountings.names[silent[0]]}",
        )


def block_of(
    frame: AdjustmentFrame,
    given: GivenOrientations,
    points: tuple[str, ...],
    object_point: Floats,
    settings: AdjustmentSettings,
    calibration: BlockSelfCalibration | None = None,
    begin: tuple[Floats, Floats] | None = None,
    rig: Rig | None = None,
) -> Block:
    """The block of the given images and object points (m, 3) with their approximate values.

    Parameters
    ----------
    begin : approximate projection centres and rotations of the images, of a rig those of its events; None:
        those of the given orientations.
    rig : which heads took the images of which event; None: every image is an event.
    """
    centre, local_from_camera = given.orientations() if begin is None else begin
    return Block(
        frame,
        given.mountings.cameras,
        given.image,
        given.camera,
        given.flights,
        given.flight_of_image,
        points,
        system_parameters(given, settings) + (() if calibration is None else (calibration.parameters,)),
        centre,
        local_from_camera,
        object_point,
        rig=rig,
    )
