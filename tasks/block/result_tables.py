"""From an adjusted block to tables: with ``block_input`` the only place that knows both.

Local coordinates, radians and metres become map coordinates, degrees and the units of the contract.
Standard deviations are multiplied by the σ0 the project asks for (a posteriori, or 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.geometry import rotation
from adjust.observations.base import ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, map_from_local
from tasks.tables import schemas
from tasks.tables.parquet import write_table

STATUS_NAMES = {
    ObservationStatus.USED: "used",
    ObservationStatus.REJECTED: "rejected",
    ObservationStatus.UNCONTROLLED: "uncontrolled",
    ObservationStatus.NOT_USED: "not_used",
}
_DEGREE = float(np.rad2deg(1.0))


@dataclass(frozen=True, eq=False)
class AdjustedBlock:
    """A result with what is needed to write it down.

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

    @property
    def rays_used(self) -> Ints:
        """(m,) number of image points that each object point kept."""
        group = self.result.groups[0]
        kept = np.isin(group.status[:, 0], (ObservationStatus.USED, ObservationStatus.UNCONTROLLED))
        kept |= np.isin(group.status[:, 1], (ObservationStatus.USED, ObservationStatus.UNCONTROLLED))
        return np.bincount(group.group.point[kept], minlength=len(self.block.points)).astype(np.int64)


def write_exterior_orientations(folder: Path, adjusted: AdjustedBlock) -> None:
    """exterior_orientations.parquet: map coordinates, ω, φ, κ against the grid, standard deviations.

    The scale of the map projection (a few 1e-4) is not applied to the standard deviations.
    """
    state = adjusted.result.state
    x_in_map = map_from_local(adjusted.map_frame, adjusted.frame, state.projection_centre)
    grid = local_from_grid(adjusted.map_frame, adjusted.frame, x_in_map)
    grid_from_local = np.swapaxes(grid, 1, 2)
    angles = rotation.to_omega_phi_kappa(grid_from_local @ state.local_from_camera)
    from_small_rotation = np.asarray(np.linalg.inv(rotation.omega_phi_kappa_jacobian(angles)), np.float64)
    cofactor = adjusted.result.cofactor.reduced.of_exposures
    of_position = _sigmas(grid_from_local, cofactor[:, :3, :3], adjusted.sigma0)
    of_angles = _sigmas(from_small_rotation, cofactor[:, 3:, 3:], adjusted.sigma0) * _DEGREE
    write_table(
        folder / "exterior_orientations.parquet",
        schemas.EXTERIOR_ORIENTATIONS,
        {
            "image": adjusted.block.images,
            **_columns("{}_m", "xyz", x_in_map),
            **_columns("{}_deg", ("omega", "phi", "kappa"), angles * _DEGREE),
            **_columns("sigma_{}_m", "xyz", of_position),
            **_columns("sigma_{}_deg", ("omega", "phi", "kappa"), of_angles),
        },
        adjusted.map_frame,
    )


def write_object_points(folder: Path, adjusted: AdjustedBlock) -> None:
    """object_points.parquet: the points that took part, with standard deviations along the grid axes."""
    active = np.flatnonzero(adjusted.result.active_point)
    x_in_local = adjusted.result.state.object_point[active]
    x_in_map = map_from_local(adjusted.map_frame, adjusted.frame, x_in_local)
    grid = local_from_grid(adjusted.map_frame, adjusted.frame, x_in_map)
    cofactor = adjusted.result.cofactor.of_points[active]
    write_table(
        folder / "object_points.parquet",
        schemas.OBJECT_POINTS,
        {
            "point": np.array(adjusted.block.points, dtype=object)[active],
            **_columns("{}_m", "xyz", x_in_map),
            **_columns("sigma_{}_m", "xyz", _sigmas(np.swapaxes(grid, 1, 2), cofactor, adjusted.sigma0)),
            "rays": adjusted.rays_used[active],
        },
        adjusted.map_frame,
    )


def write_residuals(folder: Path, adjusted: AdjustedBlock) -> None:
    """residuals.parquet: every component of every observation, also what was rejected or never used."""
    parts = [_group_rows(adjusted.block, group) for group in adjusted.result.groups]
    unused = adjusted.unused
    for component in ("x", "y"):
        parts.append(
            pd.DataFrame(
                {
                    "group": ImagePoints.name,
                    "image": unused["image"],
                    "point": unused["point"],
                    "component": component,
                    "residual": np.nan,
                    "sigma": unused[f"sigma_{component}_mm"] * 1e3,
                    "unit": "um",
                    "redundancy": np.nan,
                    "standardized": np.nan,
                    "mdb": np.nan,
                    "external": np.nan,
                    "status": "not_used",
                }
            )
        )
    table = pd.concat([part for part in parts if len(part)], ignore_index=True)
    write_table(
        folder / "residuals.parquet",
        schemas.RESIDUALS,
        {name: table[name].to_numpy() for name in table.columns},
    )


def _group_rows(block: Block, group: GroupResult) -> pd.DataFrame:
    """One row for each observed component of a group."""
    observations = group.group
    unit, factor = reported_unit_of(observations)
    row, component = np.nonzero(np.isfinite(group.sigma))
    image, point = observations.image[row], observations.point[row]
    names = np.array([STATUS_NAMES[status] for status in ObservationStatus], dtype=object)
    titles = np.full(len(row), observations.name, dtype=object)
    if isinstance(observations, DirectObservations):
        entities = next(p.entities for p in block.system if p.family.name == observations.family)
        titles = np.array(
            [f"{observations.name}:{entities[e]}" for e in observations.entity[row]], dtype=object
        )
    return pd.DataFrame(
        {
            "group": titles,
            "image": _names(block.images, image),
            "point": _names(block.points, point),
            "component": np.array(observations.components, dtype=object)[component],
            "residual": group.residual[row, component] * factor,
            "sigma": group.sigma[row, component] * factor,
            "unit": unit,
            "redundancy": group.redundancy[row, component],
            "standardized": group.standardized[row, component],
            "mdb": group.detectable[row, component] * factor,
            "external": group.external[row, component],
            "status": names[group.status[row, component]],
        }
    )


def reported_unit_of(observations: ObservationGroup) -> tuple[str, float]:
    """Unit in the tables and the factor from SI and radians."""
    if isinstance(observations, ImagePoints):
        return "um", 1e6
    if isinstance(observations, DirectObservations) and observations.family == INTERIOR_ORIENTATION:
        return "um", 1e6
    return ("deg", _DEGREE) if observations.unit == "rad" else (observations.unit, 1.0)


def _names(names: tuple[str, ...], index: Ints) -> np.ndarray:
    """Names (n,) of indices; None for −1."""
    return np.array([*names, None], dtype=object)[index]


def write_control_residuals(folder: Path, adjusted: AdjustedBlock) -> None:
    """control_residuals.parquet and check_points.parquet: computed − given along east, north, up.

    The predicted standard deviation of a control residual is that of v (√(σ² − q)), that of a check
    point contains its survey (√(σ² + q)).
    """
    for is_check, schema in ((False, schemas.CONTROL_RESIDUALS), (True, schemas.CHECK_POINTS)):
        table = surveyed_differences(adjusted, is_check)
        write_table(
            folder / f"{schema.name}.parquet",
            schema,
            {name: table[name].to_numpy() for name in table.columns},
        )


def surveyed_differences(adjusted: AdjustedBlock, is_check: bool) -> pd.DataFrame:
    """Columns of control_residuals or check_points for the points that took part."""
    surveyed, result = adjusted.surveyed, adjusted.result
    index = pd.Index(adjusted.block.points).get_indexer(pd.Index(surveyed.name))
    chosen = np.flatnonzero((index >= 0) & (surveyed.is_check == is_check))
    chosen = chosen[result.active_point[index[chosen]]]
    points = index[chosen]
    computed = result.state.object_point[points]
    given = surveyed.x_in_local[chosen]
    anchor = np.where(np.isfinite(given), given, computed)
    axes = np.array(adjusted.frame.local_from_enu(anchor))
    difference = np.einsum("nji,nj->ni", axes, computed - anchor)
    if len(chosen):
        difference[:, 2] = adjusted.frame.height(computed) - surveyed.height[chosen]
    difference = np.where(surveyed.present[chosen], difference, np.nan)
    spread = _variances(np.swapaxes(axes, 1, 2), result.cofactor.of_points[points]) * adjusted.sigma0**2
    given_variance = np.diagonal(surveyed.covariance[chosen], axis1=1, axis2=2)
    if is_check:
        variance = given_variance + spread
    else:
        variance = np.maximum(given_variance * adjusted.sigma0**2 - spread, 0.0)
    sigma = np.where(surveyed.present[chosen], np.sqrt(variance), np.nan)
    return pd.DataFrame(
        {
            "point": np.array(surveyed.name, dtype=object)[chosen],
            **_columns("{}_m", ("dx", "dy", "dz"), difference),
            **_columns("sigma_{}_m", ("dx", "dy", "dz"), sigma),
            "rays": adjusted.rays_used[points],
        }
    )


def _variances(target_from_source: Floats, cofactor: Floats) -> Floats:
    """Diagonals (n, 3) of T Q Tᵀ."""
    return np.asarray(np.einsum("nij,njk,nik->ni", target_from_source, cofactor, target_from_source))


def _sigmas(target_from_source: Floats, cofactor: Floats, sigma0: float) -> Floats:
    """Standard deviations (n, 3) along the target axes."""
    return np.asarray(sigma0 * np.sqrt(_variances(target_from_source, cofactor)))


def _columns(pattern: str, names: str | tuple[str, ...], values: Floats) -> dict[str, Floats]:
    """Columns of an array (n, k), named by a pattern."""
    return {pattern.format(name): values[:, k] for k, name in enumerate(names)}
