"""The stereo models of a flight and their y-parallaxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.georeferencing.relative_orientation import RelativeOrientation, relative_orientation
from adjust.georeferencing.y_parallax import (
    CommonPoints,
    StereoModels,
    YParallaxes,
    common_points,
    consecutive_images,
    y_parallaxes,
)
from tasks.block.given_orientations import GivenOrientations
from tasks.coordinates.local_frame import map_from_local
from tasks.georeferencing.directly_oriented import DirectlyOriented

_UM = 1e6


@dataclass(frozen=True, eq=False)
class ModelRays:
    """The models of consecutive images, and the points that both images of each show."""

    models: StereoModels
    common: CommonPoints


@dataclass(frozen=True, eq=False)
class ModelParallaxes:
    """y-parallaxes of all models, tested against the relative orientation of each."""

    rays: ModelRays
    parallaxes: YParallaxes
    relative: RelativeOrientation

    @property
    def used(self) -> Bools:
        """(q,) points that follow the relative orientation of their model, or cannot be tested."""
        return ~self.relative.is_gross_error


def model_rays(oriented: DirectlyOriented) -> ModelRays:
    """Consecutive images of every strip (images of different flights or cameras form no model)."""
    models = consecutive_images(_sequences(oriented.given), _order(oriented.given))
    return ModelRays(models, common_points(oriented.rays, models))


def model_parallaxes(oriented: DirectlyOriented, rays: ModelRays, critical_value: float) -> ModelParallaxes:
    """y-parallaxes of all common points."""
    parallaxes = y_parallaxes(oriented.rays, oriented.sources, rays.common)
    return ModelParallaxes(rays, parallaxes, relative_orientation(parallaxes, critical_value))


def _sequences(given: GivenOrientations) -> Ints:
    """(n,) number of the strip, flight and camera of each image; −1 where the strip is not known."""
    table = pd.DataFrame({"flight": given.flight, "strip": given.strip, "camera": given.camera})
    number = table.groupby(["flight", "strip", "camera"], sort=True).ngroup().to_numpy(np.int64)
    return np.where(np.array(given.strip, dtype=object) == "", -1, number)


def _order(given: GivenOrientations) -> Floats:
    """(n,) time, or the position along the strip if it has no times."""
    order = np.zeros(len(given.image))
    sequence = _sequences(given)
    for strip in np.unique(sequence):
        own = np.flatnonzero(sequence == strip)
        time = given.time_s[own]
        order[own] = time if np.isfinite(time).all() else _along(given.observed[own])
    return order


def _along(positions: Floats) -> Floats:
    """Places (k,) of positions (k, 3) along their line of best fit."""
    centred = positions - positions.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    # Either way round is in order; the sign is fixed so that it does not depend on the platform.
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    return np.asarray(centred @ direction)


def parallax_columns(oriented: DirectlyOriented, found: ModelParallaxes) -> dict[str, np.ndarray]:
    """Columns of y_parallaxes.parquet."""
    common, parallaxes = found.rays.common, found.parallaxes
    images = np.array(oriented.given.image, dtype=object)
    rays = oriented.rays
    return {
        "left": images[rays.image[common.left]],
        "right": images[rays.image[common.right]],
        "point": np.array(oriented.points, dtype=object)[rays.point[common.left]],
        "parallax_um": parallaxes.parallax * _UM,
        "sigma_um": np.sqrt(parallaxes.variance()) * _UM,
        "sigma_image_um": np.sqrt(parallaxes.by_image_points) * _UM,
        "remaining_um": found.relative.residual * _UM,
        "status": np.where(found.used, "used", "mismatch").astype(object),
    }


def model_columns(oriented: DirectlyOriented, found: ModelParallaxes) -> dict[str, np.ndarray]:
    """Columns of stereo_models.parquet."""
    models, model = found.rays.models, found.rays.common.model
    given, state = oriented.given, oriented.sources.orientations.state
    left, right = (state.projection_centre[image] for image in (models.left, models.right))
    used, count = found.used, models.count
    middle = np.zeros((0, 3))
    if count:
        middle = map_from_local(oriented.map_frame, oriented.frame, 0.5 * (left + right))
    points = np.bincount(model[used], minlength=count)
    parallax = np.where(used, found.parallaxes.parallax, 0.0) * _UM
    largest = np.zeros(count)
    np.maximum.at(largest, model, np.abs(parallax))
    remaining = np.where(used, found.relative.residual, np.nan) * _UM
    tested = np.isfinite(remaining)
    image, strip = np.array(given.image, dtype=object), np.array(given.strip, dtype=object)
    flight = np.array([name or None for name in given.flight], dtype=object)
    return {
        "left": image[models.left],
        "right": image[models.right],
        "strip": strip[models.left],
        "flight": flight[models.left],
        **{f"{axis}_m": middle[:, k] for k, axis in enumerate("xyz")},
        "base_m": np.linalg.norm(right - left, axis=1),
        "points": points,
        "mismatches": np.bincount(model[~used], minlength=count),
        "rms_um": _rms(model, parallax**2, points),
        "max_um": np.where(points > 0, largest, np.nan),
        "predicted_rms_um": _rms(model, np.where(used, found.parallaxes.variance(), 0.0) * _UM**2, points),
        "remaining_rms_um": _rms(
            model, np.nan_to_num(remaining) ** 2, np.bincount(model[tested], minlength=count)
        ),
    }


def _rms(model: Ints, squares: Floats, points: Ints) -> Floats:
    """√(mean) of squares (q,) in each model; NaN without points."""
    total = np.bincount(model, weights=squares, minlength=len(points))
    return np.where(points > 0, np.sqrt(total / np.maximum(points, 1)), np.nan)
