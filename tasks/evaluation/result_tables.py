"""From an adjusted block to tables: with ``block_input`` the only place that knows both.

Local coordinates, radians and metres become map coordinates, degrees and the units of the contract.
Standard deviations are multiplied by the σ0 the project asks for (a posteriori, or 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.geometry import rotation
from adjust.observations.base import ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.observations.image_point import ImagePoints
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.quality.cofactor import Cofactor
from adjust.quality.considered import with_considered
from adjust.quality.picture_cofactor import picture_cofactors
from adjust.result import AdjustmentResult, ObservationStatus
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, map_from_local
from tasks.tables.geometry import box_around
from tasks.tables.names import Names
from tasks.tables.parquet import write_row_groups, write_stage_table
from tasks.tables.places import places_of
from tasks.tables.schemas.adjustment import EXTERIOR_ORIENTATIONS, OBJECT_POINTS

_DEGREE = float(np.rad2deg(1.0))
#: Rows of a long table that are put into columns at once: some ten megabytes.
PIECE = 50_000


@dataclass(frozen=True, eq=False)
class AdjustedBlock:
    """A result with all that is needed to write its tables.

    Attributes
    ----------
    sigma0 : factor of all standard deviations.
    surveyed : control and check points.
    unused : image points (image, point, sigma_x_mm, sigma_y_mm) that never entered the adjustment.
    """

    block: Block
    result: AdjustmentResult
    map_frame: MapFrame
    frame: AdjustmentFrame
    sigma0: float
    surveyed: SurveyedPoints
    unused: pd.DataFrame

    @cached_property
    def cofactor(self) -> Cofactor:
        """Cofactors that, times σ0², are covariances; they include the errors of considered parameters."""
        return with_considered(self.result.cofactor, self.sigma0)

    @cached_property
    def surveyed_point(self) -> Ints:
        """(k,) object point of each control and check point; −1 if it is not in the block."""
        return places_of(self.surveyed.name, self.block.points)

    @cached_property
    def rays_used(self) -> Ints:
        """(m,) number of image points that each object point kept."""
        group = self.result.groups[0]
        kept = np.isin(group.status[:, 0], (ObservationStatus.USED, ObservationStatus.UNCONTROLLED))
        kept |= np.isin(group.status[:, 1], (ObservationStatus.USED, ObservationStatus.UNCONTROLLED))
        return np.bincount(group.group.point[kept], minlength=len(self.block.points)).astype(np.int64)


def write_exterior_orientations(folder: Path, adjusted: AdjustedBlock) -> None:
    """exterior_orientations.parquet: map coordinates, ω, φ, κ against the grid, with their covariance.

    The scale of the map projection (a few 1e-4) is not applied to the standard deviations.
    """
    x_in_map, angles, grid_from_local = _in_map(adjusted)
    axes = axes_of_orientations(adjusted)
    result = adjusted.result
    cofactor = picture_cofactors(result.state, result.layout, result.cofactor, adjusted.sigma0)
    of_position = _sigmas(grid_from_local, cofactor[:, :3, :3], adjusted.sigma0)
    of_angles = _sigmas(axes[:, 3:, 3:], cofactor[:, 3:, 3:], adjusted.sigma0) * _DEGREE
    columns = {
        "image": adjusted.block.images,
        **xyz_columns("{}_m", "xyz", x_in_map),
        **xyz_columns("{}_deg", ("omega", "phi", "kappa"), angles * _DEGREE),
        **xyz_columns("sigma_{}_m", "xyz", of_position),
        **xyz_columns("sigma_{}_deg", ("omega", "phi", "kappa"), of_angles),
        **_correlations(grid_from_local, axes[:, 3:, 3:], cofactor),
    }
    write_stage_table(folder, EXTERIOR_ORIENTATIONS, columns, adjusted.map_frame)


def _in_map(adjusted: AdjustedBlock) -> tuple[Floats, Floats, Floats]:
    """Projection centres (n, 3) in the map, ω, φ, κ (n, 3) against its grid, and its axes (n, 3, 3) there."""
    pictures = adjusted.result.state.pictures
    x_in_map = map_from_local(adjusted.map_frame, adjusted.frame, pictures.projection_centre)
    grid = local_from_grid(adjusted.map_frame, adjusted.frame, x_in_map)
    grid_from_local = np.swapaxes(grid, 1, 2)
    angles = rotation.to_omega_phi_kappa(grid_from_local @ pictures.local_from_camera)
    return x_in_map, angles, grid_from_local


def axes_of_orientations(adjusted: AdjustedBlock) -> Floats:
    """(n, 6, 6) from small changes of position and attitude to those of map coordinates and ω, φ, κ."""
    _, angles, grid_from_local = _in_map(adjusted)
    axes = np.zeros((len(angles), 6, 6))
    axes[:, :3, :3] = grid_from_local
    axes[:, 3:, 3:] = np.linalg.inv(rotation.omega_phi_kappa_jacobian(angles))
    return axes


def write_object_points(folder: Path, adjusted: AdjustedBlock, piece: int = PIECE) -> None:
    """object_points.parquet: the points that were used, with standard deviations along the grid axes.

    Parameters
    ----------
    piece : how many points are put into columns at once; nothing but memory depends on it.
    """
    names = Names.of(adjusted.block.points)
    points = np.flatnonzero(adjusted.result.active_point)
    points = points[np.argsort(names.rank[points])]
    parts = [points[start : start + piece] for start in range(0, len(points), piece)]
    x_in_map = np.empty((len(adjusted.block.points), 3))
    for part in parts:
        x_in_local = adjusted.result.state.object_point[part]
        x_in_map[part] = map_from_local(adjusted.map_frame, adjusted.frame, x_in_local)
    rays = adjusted.rays_used
    write_row_groups(
        folder / "object_points.parquet",
        OBJECT_POINTS,
        (_object_points(adjusted, names.take(part), part, x_in_map[part], rays[part]) for part in parts),
        adjusted.map_frame,
        box_around(x_in_map[points]),
    )


def _object_points(
    adjusted: AdjustedBlock, names: pa.Array, points: Ints, x_in_map: Floats, rays: Ints
) -> Mapping[str, Any]:
    """Columns of some object points (k,)."""
    grid = local_from_grid(adjusted.map_frame, adjusted.frame, x_in_map)
    sigmas = _sigmas(np.swapaxes(grid, 1, 2), adjusted.cofactor.of_points[points], adjusted.sigma0)
    return {
        "point": names,
        **xyz_columns("{}_m", "xyz", x_in_map),
        **xyz_columns("sigma_{}_m", "xyz", sigmas),
        "rays": rays,
    }


def reported_unit_of(observations: ObservationGroup, component: int = 0) -> tuple[str, float]:
    """Unit of a component in the tables and the factor from SI and radians."""
    if isinstance(observations, ImagePoints):
        return "um", 1e6
    unit: str = observations.unit
    if isinstance(observations, DirectObservations):
        if observations.family.name == INTERIOR_ORIENTATION:
            return "um", 1e6
        unit = observations.family.unit_of(component)
    if isinstance(observations, JointPrior):
        if observations.places[component].family == INTERIOR_ORIENTATION:
            return "um", 1e6
        unit = observations.units[component]
    return ("deg", _DEGREE) if unit == "rad" else (unit, 1.0)


def variances(target_from_source: Floats, cofactor: Floats) -> Floats:
    """Diagonals (n, 3) of T Q Tᵀ."""
    return np.asarray(np.einsum("nij,njk,nik->ni", target_from_source, cofactor, target_from_source))


def _sigmas(target_from_source: Floats, cofactor: Floats, sigma0: float) -> Floats:
    """Standard deviations (n, 3) along the target axes."""
    return np.asarray(sigma0 * np.sqrt(variances(target_from_source, cofactor)))


def _correlations(of_position: Floats, of_angles: Floats, cofactor: Floats) -> dict[str, Floats]:
    """Correlations of the six elements of n orientations, from cofactors (n, 6, 6) in other axes each."""
    turn = np.zeros_like(cofactor)
    turn[:, :3, :3], turn[:, 3:, 3:] = of_position, of_angles
    spread = turn @ cofactor @ np.swapaxes(turn, 1, 2)
    sigma = np.sqrt(np.einsum("nii->ni", spread))
    pairs = combinations(enumerate((*"xyz", "omega", "phi", "kappa")), 2)
    return {
        f"correlation_{one}_{other}": spread[:, i, j] / (sigma[:, i] * sigma[:, j])
        for (i, one), (j, other) in pairs
    }


def xyz_columns(pattern: str, names: str | tuple[str, ...], values: Floats) -> dict[str, Floats]:
    """Columns of an array (n, k), named by a pattern."""
    return {pattern.format(name): values[:, k] for k, name in enumerate(names)}
