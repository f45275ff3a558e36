"""Correlation of the errors of neighbouring images, and σ of their differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.quality.picture_cofactor import cofactors_between_pictures, picture_cofactors
from tasks.deliveries.neighbouring_images import neighbours
from tasks.evaluation.result_tables import AdjustedBlock, axes_of_orientations, xyz_columns
from tasks.tables.parquet import write_stage_table
from tasks.tables.places import places_of
from tasks.tables.schemas.adjustment import NEIGHBOURING_IMAGES

_DEGREE = float(np.rad2deg(1.0))
_ANGLES = ("omega", "phi", "kappa")


def write_neighbouring_images(folder: Path, adjusted: AdjustedBlock, exposures: pd.DataFrame) -> None:
    """neighbouring_images.parquet: images that follow each other in a strip and share an object point.

    With the cofactors Q of the adjustment in the axes of the orientations, ρ = Q_ij / √(Q_ii Q_jj) and the
    variance of a difference is σ0² (Q_ii + Q_jj − 2 Q_ij).
    """
    one, other = (
        places_of(exposures["image"].iloc[rows], adjusted.block.images) for rows in neighbours(exposures)
    )
    result, sigma0 = adjusted.result, adjusted.sigma0
    event = adjusted.block.event_of_image
    known = (one >= 0) & (other >= 0)
    one, other = one[known], other[known]
    together = result.cofactor.reduced.pattern.find(event[one], event[other]) >= 0
    one, other = one[together], other[together]
    axes = axes_of_orientations(adjusted)
    own = (
        axes
        @ picture_cofactors(result.state, result.layout, result.cofactor, sigma0)
        @ np.swapaxes(axes, 1, 2)
    )
    mixed = cofactors_between_pictures(result.state, result.layout, result.cofactor, sigma0, one, other)
    between = axes[one] @ mixed @ np.swapaxes(axes[other], 1, 2)
    first, second, both = (_diagonals(part) for part in (own[one], own[other], between))
    correlation = both / np.sqrt(first * second)
    sigma = sigma0 * np.sqrt(np.maximum(first + second - 2.0 * both, 0.0))
    names = np.array(adjusted.block.images, dtype=object)
    columns = {
        "image": names[one],
        "next_image": names[other],
        **xyz_columns("rho_{}", (*"xyz", *_ANGLES), correlation),
        **xyz_columns("sigma_d{}_m", "xyz", sigma[:, :3]),
        **xyz_columns("sigma_d{}_deg", _ANGLES, sigma[:, 3:] * _DEGREE),
    }
    write_stage_table(folder, NEIGHBOURING_IMAGES, columns)


def _diagonals(matrices: Floats) -> Floats:
    """(n, 6) of (n, 6, 6)."""
    return np.diagonal(matrices, axis1=1, axis2=2)
