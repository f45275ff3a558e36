"""Approximate orientations of images that were given none, or half of one, from their image points."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.approximate.measured_images import MeasuredImages
from adjust.approximate.placement import KnownPlaces, Placement
from adjust.approximate.unoriented import find_orientations
from adjust.arrays import Floats, Ints
from adjust.geometry import rotation
from tasks.block.block_input import control_distances, image_point_observations, surveyed_points
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.block.oriented_images import OPK_DEG, XYZ_M, has_attitude, has_position, measured_exposures
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import (
    AdjustmentFrame,
    local_frame,
    local_from_grid,
    local_from_map,
    map_from_local,
)
from tasks.errors import InputError
from tasks.tables.number_columns import numbers_of

_log = logging.getLogger("aerocal")


@dataclass(frozen=True, eq=False)
class FoundImages:
    """The stored record.

    Attributes
    ----------
    table : rows of approximate_orientations.parquet.
    remarks : how it was found, for people.
    """

    table: pd.DataFrame
    remarks: tuple[str, ...]


def found_orientations(
    exposures: pd.DataFrame,
    cameras: pd.DataFrame,
    measured: pd.DataFrame,
    control: pd.DataFrame,
    distances: pd.DataFrame,
    map_frame: MapFrame,
) -> FoundImages:
    """Orient the measured images that lack a position or an attitude.

    Raises
    ------
    InputError
        If nothing says where a block in map coordinates is.
    """
    own = measured_exposures(exposures, cameras, measured)
    lacking = ~(has_position(own) & has_attitude(own))
    if not lacking.any():
        return FoundImages(pd.DataFrame(columns=["image", "camera", *XYZ_M, *OPK_DEG]), ())
    places = _places(own, control)
    if len(places) == 0 and not map_frame.is_local:
        raise InputError(
            "No exposure has a position and no control point has x, y and z, so the location of the block "
            f"in {map_frame.name} is unknown.",
            'Give full control points or positions, or adjust it as a free network with crs = "local".',
        )
    frame = local_frame(map_frame, places)
    mountings = Mountings.from_table(cameras[cameras["camera"].isin(own["camera"].unique())])
    camera = pd.Index(mountings.names).get_indexer(pd.Index(own["camera"])).astype(np.int64)
    points = tuple(np.unique(measured["point"].to_numpy(dtype=object)))
    rays, _ = image_point_observations(measured, tuple(own["image"]), points, camera)
    images = MeasuredImages(rays, mountings.cameras, len(points))
    known = KnownPlaces(
        _control(control, points, map_frame, frame),
        _positions(own, map_frame, frame),
        _attitudes(own, mountings, map_frame, frame, places),
        *_distances(distances, points),
        mountings.up_in_camera[camera],
    )
    found = find_orientations(images, known, _report)
    chosen = np.flatnonzero(lacking & found.model.oriented)
    x_in_map = map_from_local(map_frame, frame, found.model.projection_centre[chosen])
    grid = np.swapaxes(local_from_grid(map_frame, frame, x_in_map), 1, 2)
    angles = np.rad2deg(rotation.to_omega_phi_kappa(grid @ found.model.local_from_camera[chosen]))
    table = own.iloc[chosen][["image", "camera"]].reset_index(drop=True)
    table[XYZ_M], table[OPK_DEG] = x_in_map, angles
    return FoundImages(table, _remarks(own, lacking, len(chosen), found.placements))


def _places(own: pd.DataFrame, control: pd.DataFrame) -> Floats:
    """Positions (k, 3) on the map that locate the block: those of exposures, otherwise of control."""
    given = numbers_of(own, XYZ_M)[has_position(own)]
    surveyed = numbers_of(control, XYZ_M)
    return given if len(given) else np.asarray(surveyed[np.isfinite(surveyed).all(axis=1)])


def _control(
    control: pd.DataFrame, points: tuple[str, ...], map_frame: MapFrame, frame: AdjustmentFrame
) -> Floats:
    """Coordinates (m, 3) of the full control points among the object points, NaN for the others."""
    surveyed = surveyed_points(control, map_frame, frame)
    result = np.full((len(points), 3), np.nan)
    rows, place = surveyed.control_among(points)
    full = surveyed.complete[rows]
    result[place[full]] = surveyed.x_in_local[rows[full]]
    return result


def _distances(distances: pd.DataFrame, points: tuple[str, ...]) -> tuple[Ints, Floats]:
    """Both ends (k, 2) of the control distances between object points, and their lengths (k,)."""
    own, ends = control_distances(distances, points)
    return ends, own["distance_m"].to_numpy(np.float64)


def _positions(own: pd.DataFrame, map_frame: MapFrame, frame: AdjustmentFrame) -> Floats:
    """Given positions (n, 3) in the local frame, NaN where there is none."""
    placed, result = has_position(own), np.full((len(own), 3), np.nan)
    if placed.any():
        result[placed] = local_from_map(map_frame, frame, own.loc[placed, XYZ_M].to_numpy(np.float64))
    return result


def _attitudes(
    own: pd.DataFrame, mountings: Mountings, map_frame: MapFrame, frame: AdjustmentFrame, places: Floats
) -> Floats:
    """Given rotations (n, 3, 3) local from camera, NaN where there is none.

    Where the position is not known, the axes of map and horizon are those in the middle of the block.
    """
    turned, result = has_attitude(own), np.full((len(own), 3, 3), np.nan)
    if turned.any():
        table = own[turned].assign(position="antenna")
        middle = places.mean(axis=0) if len(places) else np.zeros(3)
        table[XYZ_M] = table[XYZ_M].fillna(dict(zip(XYZ_M, middle, strict=True)))
        result[turned] = GivenOrientations.from_tables(table, mountings, map_frame, frame).orientations()[1]
    return result


def _report(oriented: int, images: int) -> None:
    """One line for each round."""
    _log.info("approximate_values: %d of %d images are oriented", oriented, images)


def _remarks(
    own: pd.DataFrame, lacking: np.ndarray, found: int, placements: tuple[Placement, ...]
) -> tuple[str, ...]:
    """Sentences on what was oriented and what located it."""
    if found == 0:
        return ()
    kinds = [
        f"{int((lacking & ~known).sum()):,} without {what}"
        for known, what in ((has_position(own), "position"), (has_attitude(own), "attitude"))
        if (lacking & ~known).any()
    ]
    remarks = [
        f"{found:,} images were oriented by their image points ({', '.join(kinds)}): approximate values, "
        "not observations."
    ]
    if any(not item.turned for item in placements):
        remarks.append(
            "Control points and positions lie on one line or are too few to determine the rotation of "
            "the block: the body of its cameras was assumed to be level."
        )
    if any(not item.scaled for item in placements):
        remarks.append(
            "The scale of the block is not determined; that of its approximate values is arbitrary."
        )
    return tuple(remarks)
