"""Joint errors of the strips of an adjustment as a table: what their scatter hides from a second step."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.calibration.adjusted_strips import StripErrors, adjusted_strip_errors
from adjust.georeferencing.error_sources import CalibrationErrors
from tasks.block.given_orientations import GivenOrientations
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.quantities import reported_unit
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.calibration import STRIP_ERRORS

COMPONENTS = ("roll", "pitch", "yaw", "east", "north", "up")
_SHOWN = np.array([np.rad2deg(1.0)] * 3 + [1.0] * 3)


def write_strip_errors(
    folder: Path,
    adjusted: AdjustedBlock,
    given: GivenOrientations,
    parameters: pd.DataFrame,
    correlations: pd.DataFrame,
) -> None:
    """strip_errors.parquet.

    Parameters
    ----------
    parameters, correlations : of the adjustment that calibrated the cameras, which are held here.
    """
    cameras = _held(adjusted, sigmas_of(parameters), correlations)
    names = list(given.mountings.names)
    parts = [
        _of_camera(adjusted, given, number, name, cameras)
        for number, name in enumerate(names)
        if (given.camera == number).any()
    ]
    table = pd.concat(parts, ignore_index=True)
    write_stage_table(folder, STRIP_ERRORS, table)


def _held(
    adjusted: AdjustedBlock, sigmas: Mapping[Key, float], correlations: pd.DataFrame
) -> CalibrationErrors:
    """Errors of the parameters of the cameras that are held and were calibrated before."""
    keys, factors, columns = list[Key](), list[float](), {}
    for item in adjusted.block.system:
        column = np.full(item.values.shape, -1, dtype=np.int64)
        for entity, component in np.ndindex(item.values.shape):
            quantity = item.quantity(entity, component)
            key = quantity.name, quantity.entity
            if item.family.entity_kind == "camera" and key in sigmas and not item.free[entity, component]:
                column[entity, component] = len(keys)
                keys.append(key)
                factors.append(reported_unit(item.family, component)[1])
        columns[item.family.name] = column
    covariance = covariance_of(keys, sigmas, correlation_pairs(correlations))
    scale = np.array(factors)
    return CalibrationErrors(columns, covariance / np.outer(scale, scale))


def _of_camera(
    adjusted: AdjustedBlock,
    given: GivenOrientations,
    number: int,
    name: str,
    cameras: CalibrationErrors,
) -> pd.DataFrame:
    own = given.camera == number
    of_camera = given.only(own)
    strip = np.full(len(own), -1, dtype=np.int64)
    strip[own] = of_camera.strip_of_image
    errors = adjusted_strip_errors(
        adjusted.block, adjusted.result, strip, given.local_from_enu, cameras, adjusted.sigma0
    )
    return _rows(name, of_camera.strips, errors)


def _rows(camera: str, strips: tuple[str, ...], errors: StripErrors) -> pd.DataFrame:
    shown = errors.covariance * _SHOWN[:, None, None] * _SHOWN
    index = np.indices(shown.shape).reshape(4, -1)
    strip, component = np.array(strips, dtype=object), np.array(COMPONENTS, dtype=object)
    return pd.DataFrame(
        {
            "camera": camera,
            "strip_a": strip[index[0]],
            "component_a": component[index[1]],
            "strip_b": strip[index[2]],
            "component_b": component[index[3]],
            "covariance": shown.ravel(),
        }
    )


def strip_errors_of(table: pd.DataFrame, camera: str, strips: tuple[str, ...]) -> StripErrors | None:
    """Errors of some strips of a camera in strip_errors.parquet; None if one of them is not there."""
    own = table[table["camera"] == camera]
    places = {side: pd.Index(strips).get_indexer(pd.Index(own[f"strip_{side}"])) for side in ("a", "b")}
    components = {
        side: pd.Index(COMPONENTS).get_indexer(pd.Index(own[f"component_{side}"])) for side in ("a", "b")
    }
    kept = (places["a"] >= 0) & (places["b"] >= 0)
    covariance: Floats = np.full((len(strips), 6, len(strips), 6), np.nan)
    shown = own["covariance"].to_numpy(np.float64)[kept]
    covariance[places["a"][kept], components["a"][kept], places["b"][kept], components["b"][kept]] = shown
    if not np.isfinite(covariance).all():
        return None
    return StripErrors(covariance / (_SHOWN[:, None, None] * _SHOWN))
