"""platform.parquet and virtual_image.parquet: heads of a platform, and the virtual image composed of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.virtual_image import composed, composition_errors, covering_heads, in_heads
from adjust.geometry import rotation
from tasks.calibration.platform import AdjustedPlatform, adjusted_platforms
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table, write_stage_table
from tasks.tables.schemas.calibration import PLATFORM, VIRTUAL_IMAGE

_ANGLES = ("omega", "phi", "kappa")
# Points of the grid along the shorter side of the virtual image.
_POINTS = 24
# Ground that is nearer by this part shows how the seams open.
_NEARER = 0.9


@stored("platform")
def describe_platform(
    folder: Path, *, parameters: Artifact, correlations: Artifact, cameras: Artifact, images: Artifact
) -> None:
    """Write the heads of all platforms that take no pictures, and their virtual images on a grid, if any.

    Parameters
    ----------
    parameters, correlations, cameras, images : the tables of these names of the adjusted flight.
    """
    platforms = tuple(
        adjusted_platforms(*(read_table(table) for table in (parameters, correlations, cameras, images)))
    )
    if platforms:
        heads, grid = (_together([of(one) for one in platforms]) for of in (_heads, _grid))
        write_stage_table(folder, PLATFORM, heads)
        write_stage_table(folder, VIRTUAL_IMAGE, grid)
    write_notes(folder, Notes(tuple(_sentence(platform) for platform in platforms)))


def _together(parts: Sequence[Mapping[str, Sequence[Any] | Floats]]) -> dict[str, list[Any]]:
    return {name: [value for part in parts for value in part[name]] for name in parts[0]}


def _heads(platform: AdjustedPlatform) -> Mapping[str, Sequence[Any] | Floats]:
    """Columns of platform.parquet."""
    angles, covariance = platform.angles()
    heads = len(platform.head)
    sigma = np.sqrt(np.diagonal(covariance))
    correlation = np.abs(covariance / np.outer(sigma, sigma)).reshape(heads, 3, heads, 3).max(axis=(1, 3))
    correlation[np.arange(heads), np.arange(heads)] = -1.0
    given = np.rad2deg(rotation.to_omega_phi_kappa(platform.given.platform_from_head))
    columns: dict[str, Sequence[Any] | Floats] = {
        "platform": [platform.name] * heads,
        "head": platform.head,
        **dict(zip(("x_m", "y_m", "z_m"), platform.adjusted.position.T, strict=True)),
        "probability": platform.probability,
        "correlation": correlation.max(axis=1),
        "correlated_with": [platform.head[other] for other in correlation.argmax(axis=1)],
    }
    for place, name in enumerate(_ANGLES):
        columns |= {
            f"{name}_deg": np.rad2deg(angles[:, place]),
            f"sigma_{name}_deg": np.rad2deg(sigma.reshape(heads, 3)[:, place]),
            f"given_{name}_deg": given[:, place],
        }
    return columns


def _grid(platform: AdjustedPlatform) -> Mapping[str, Sequence[Any] | Floats]:
    """Columns of virtual_image.parquet."""
    half, z = platform.half_format, platform.distance
    cell = 2.0 * half.min() / _POINTS
    x, y = np.meshgrid(*(_middles(side, cell) for side in half), indexing="ij")
    place = np.column_stack([x.ravel(), y.ravel()])
    error, head = composition_errors(platform.adjusted, platform.given, place, z, z)
    seam, _ = composition_errors(platform.adjusted, platform.adjusted, place, z, _NEARER * z)
    in_head, design = _of_heads(platform, place, head)
    spread = _with_correlation(design, platform.covariance)
    # Where a second head covers the point, the step between both has their joint covariance.
    beside = covering_heads(platform.given, place, z)[:, 1]
    step = _with_correlation(design - _of_heads(platform, place, beside)[1], platform.covariance)
    columns: dict[str, Sequence[Any] | Floats] = {
        "platform": [platform.name] * len(place),
        "x_mm": place[:, 0] * 1e3,
        "y_mm": place[:, 1] * 1e3,
        "head": [None if number < 0 else platform.head[number] for number in head],
    }
    for axis in range(2):
        columns |= {
            f"head_{'xy'[axis]}_mm": in_head[:, axis] * 1e3,
            f"d{'xy'[axis]}_um": error[:, axis] * 1e6,
            f"sigma_{'xy'[axis]}_um": spread[:, axis] * 1e6,
            f"seam_{'xy'[axis]}_um": seam[:, axis] * 1e6,
            f"sigma_step_{'xy'[axis]}_um": step[:, axis] * 1e6,
        }
    columns["correlation"], columns["correlation_step"] = spread[:, 2], step[:, 2]
    columns["next_head"] = [None if number < 0 else platform.head[number] for number in beside]
    return columns


def _of_heads(platform: AdjustedPlatform, place: Floats, head: Ints) -> tuple[Floats, Floats]:
    """Coordinates (n, 2) of points in heads (n,), derivatives (n, 2, 3h) by all rotations; NaN without."""
    in_head = np.full(place.shape, np.nan)
    design = np.zeros((len(place), 2, len(platform.head), 3))
    design[head < 0] = np.nan
    there = np.flatnonzero(head >= 0)
    own, z = head[there], platform.distance
    in_head[there] = in_heads(platform.adjusted, own, place[there], z)
    design[there, :, own] = composed(platform.adjusted, own, in_head[there], z).of_rotation
    return in_head, design.reshape(len(place), 2, -1)


def _with_correlation(design: Floats, covariance: Floats) -> Floats:
    """σ of x and y (n, 2) and their correlation, as (n, 3), of quantities with derivatives (n, 2, k)."""
    spread = design @ covariance @ np.swapaxes(design, 1, 2)
    sigma = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    return np.column_stack([sigma, spread[:, 0, 1] / sigma.prod(axis=1)])


def _middles(half: float, cell: float) -> Floats:
    count = max(round(2.0 * half / cell), 1)
    return np.asarray((np.arange(count) + 0.5) * 2.0 * half / count - half)


def _sentence(platform: AdjustedPlatform) -> str:
    """A sentence on what was calibrated, and on the errors of composing with the given attitudes."""
    _, covariance = platform.angles()
    error, _ = composition_errors(
        platform.adjusted, platform.given, _corners(platform), platform.distance, platform.distance
    )
    return (
        f"The attitudes of the {len(platform.head)} heads of {platform.name} are determined to "
        f"{np.rad2deg(np.sqrt(np.diagonal(covariance).max())):.5f}° against each other (mean rotation zero). "
        f"Composed for {platform.distance:.0f} m above ground, the given attitudes would be wrong by up to "
        f"{np.nanmax(np.abs(error)) * 1e6:.1f} µm in the corners of the virtual image."
    )


def _corners(platform: AdjustedPlatform) -> Floats:
    return np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * platform.half_format * 0.999
