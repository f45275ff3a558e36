"""The network of a project or of a specification; nothing is measured or adjusted.

A project has its orientations as given, its image points and control; a specification a flight plan with its
terrain, control and standard deviations.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.planning.network import (
    PlannedControl,
    PlannedDistances,
    PlannedExposures,
    PlannedNetwork,
    PlannedRays,
)
from adjust.planning.simulated_network import simulated_network
from tasks.block.assembled_block import BlockStart, DeliveredTables
from tasks.block.block_input import (
    SurveyedPoints,
    control_distances,
    image_point_observations,
    stated_values,
)
from tasks.block.given_orientations import GivenOrientations
from tasks.block.self_calibration import image_format_of
from tasks.block.shared_readings import heads_of_reading
from tasks.block.strip_motion import require_motion, strip_motion
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter
from tasks.settings.project import ProjectSettings
from tasks.settings.simulation import Simulation
from tasks.simulation.simulation_input import block_specification


def network_of_project(
    delivered: DeliveredTables,
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
    free: tuple[FreeParameter, ...] = (),
) -> PlannedNetwork:
    """The network of imported deliveries with approximate object points.

    What `adjustment.observe` leaves out is left out here, too.

    Parameters
    ----------
    free : system parameters that are to be estimated.

    Raises
    ------
    InputError
        If no image can be oriented, or strips or times are missing that free parameters or correlation times
        need.
    """
    start = BlockStart.of(delivered, MapFrame.of(project.crs, project.heights))
    given, names = start.given, start.points
    rays, _ = image_point_observations(delivered.image_points, given.image, names, given.camera)
    require_motion(start.events, adjustment.model_copy(update={"free": free}))
    mountings, cameras = given.mountings, delivered.cameras.set_index("camera")
    rows = cameras.loc[list(mountings.names)].reset_index().to_dict("records")
    turns = tuple(int(row["calibration_axes_deg"]) for row in rows)
    return PlannedNetwork(
        start.frame,
        mountings.cameras,
        given.flights,
        given.strips,
        _exposures(start.events, adjustment),
        start.x_in_local,
        PlannedRays(rays.image, rays.point, rays.sigma),
        _control(names, start.surveyed, "control" in adjustment.observe),
        stated_values(mountings),
        tuple(image_format_of(row, turn) for row, turn in zip(rows, turns, strict=True)),
        turns,
        _distances(names, delivered.distances),
        start.rig,
    )


def _exposures(given: GivenOrientations, adjustment: AdjustmentSettings) -> PlannedExposures:
    """The exposures; heads share a reading, as in `tasks.block.observation_types`."""
    centre, local_from_camera = given.orientations()
    motion, n, heads = strip_motion(given), len(given.image), heads_of_reading(given)[:, None]
    return PlannedExposures(
        given.camera,
        given.flight_of_image,
        given.strip_of_image,
        _times(given, given.strip_of_image),
        motion.velocity,
        np.nan_to_num(given.rates),
        centre,
        local_from_camera,
        given.position_sigma * np.sqrt(heads) if "gnss" in adjustment.observe else np.full((n, 3), np.nan),
        given.local_from_grid,
        np.where(
            given.attitude_observed[:, None, None], given.attitude_covariance() * heads[:, None], np.eye(3)
        ),
        given.attitude_observed & ("ins" in adjustment.observe),
    )


def _times(given: GivenOrientations, strip: Ints) -> Floats:
    """Times (n,), s; where a delivery has none, the order of the names within the strips stands for them."""
    if np.isfinite(given.time_s).all():
        return given.time_s
    return np.asarray(pd.Series(strip).groupby(strip).cumcount().to_numpy(np.float64))


def _distances(points: tuple[str, ...], table: pd.DataFrame) -> PlannedDistances | None:
    own, ends = control_distances(table, points)
    if not len(own):
        return None
    return PlannedDistances(ends[:, 0], ends[:, 1], own["sigma_m"].to_numpy(np.float64))


def _control(points: tuple[str, ...], surveyed: SurveyedPoints, observed: bool) -> PlannedControl:
    kept, index = (part if observed else part[:0] for part in surveyed.control_among(points))
    return PlannedControl(index, surveyed.covariance[kept], surveyed.present[kept])


def network_of_specification(simulation: Simulation) -> PlannedNetwork:
    """The network that a specification would give; no measurement is simulated.

    Raises
    ------
    InputError
        If the settings give no block.
    """
    try:
        return simulated_network(block_specification(simulation))
    except InconsistentBlockError as error:
        raise InputError(str(error), "Change [flight] or [points].") from error
