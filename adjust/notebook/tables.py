"""A result as tables of pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np
import pandas as pd

from adjust.observations.image_point import ImagePoints
from adjust.result import ObservationStatus
from adjust.result_columns import parameter_rows, sigma_of_images, sigma_of_points
from adjust.unknown_names import unknown_name

if TYPE_CHECKING:
    from adjust.result import AdjustmentResult

Table: TypeAlias = Literal["parameters", "images", "points", "observations"]
_AXES = ("x", "y", "z")


def table_of(result: AdjustmentResult, table: Table, sigma0: float | None = None) -> pd.DataFrame:
    """One table of a result; SI units and radians, local axes. σ of unknowns with σ0, None: of the residuals.

    Raises
    ------
    UnknownNameError : there is no such table.
    """
    if table == "parameters":
        columns = ["parameter", "entity", "value", "sigma", "unit"]
        return pd.DataFrame(parameter_rows(result, sigma0), columns=pd.Index(columns))
    if table == "images":
        return _images(result, sigma0)
    if table == "points":
        return _points(result, sigma0)
    if table == "observations":
        return _observations(result)
    raise unknown_name("table", table, get_args(Table))


def _images(result: AdjustmentResult, sigma0: float | None) -> pd.DataFrame:
    """Projection centres and their σ, m; σ of the rotation about the camera axes, rad."""
    sigma = sigma_of_images(result, sigma0)
    found = pd.DataFrame({"image": result.block.images})
    for k, axis in enumerate(_AXES):
        found[axis] = result.state.pictures.projection_centre[:, k]
    for k, axis in enumerate(_AXES):
        found[f"sigma_{axis}"] = sigma[:, k]
    for k, axis in enumerate(_AXES):
        found[f"sigma_rotation_{axis}"] = sigma[:, 3 + k]
    return found


def _points(result: AdjustmentResult, sigma0: float | None) -> pd.DataFrame:
    """Object points and their σ, m; missing for those that were not used."""
    sigma = sigma_of_points(result, sigma0)
    found = pd.DataFrame({"point": result.block.points})
    for k, axis in enumerate(_AXES):
        found[axis] = np.where(result.active_point, result.state.object_point[:, k], np.nan)
    for k, axis in enumerate(_AXES):
        found[f"sigma_{axis}"] = sigma[:, k]
    return found


def _observations(result: AdjustmentResult) -> pd.DataFrame:
    """One row for each observed component: residual, σ, redundancy number, w, what became of it."""
    words = np.array([status.name.lower() for status in ObservationStatus])
    images, events, points = (
        np.array([*names, None], dtype=object)
        for names in (result.block.images, result.block.events, result.block.points)
    )
    tables = []
    for item in result.groups:
        row, component = np.nonzero(np.isfinite(item.sigma))
        group = item.group
        of_group = images[group.image] if isinstance(group, ImagePoints) else events[group.event]
        tables.append(
            pd.DataFrame(
                {
                    "group": item.group.name,
                    "component": np.array(item.group.components, dtype=object)[component],
                    "image": of_group[row],
                    "point": points[item.group.point[row]],
                    "residual": item.residual[row, component],
                    "sigma": item.sigma[row, component],
                    "redundancy": item.redundancy[row, component],
                    "standardized": item.standardized[row, component],
                    "status": words[item.status[row, component]],
                    "unit": item.group.unit,
                }
            )
        )
    return pd.concat(tables, ignore_index=True)
