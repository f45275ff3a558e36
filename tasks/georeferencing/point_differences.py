"""Differences of directly georeferenced points from their survey, and how large they should be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import scipy.sparse

from adjust.approximate.intersection import intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.georeferencing.error_sources import SharedErrors
from adjust.georeferencing.space_intersection import PointErrors, point_errors, rays_of
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION
from tasks.block.block_input import SurveyedPoints, surveyed_points
from tasks.coordinates.local_frame import map_from_local
from tasks.georeferencing.directly_oriented import DirectlyOriented
from tasks.georeferencing.stereo_models import ModelRays

AXES = ("x", "y", "z")
INDEPENDENT, CONTROL = "independent", "control_of_calibration"


@dataclass(frozen=True, eq=False)
class SurveyedRays:
    """Rays to q intersections of surveyed points: of all images, or of the two of a model.

    Attributes
    ----------
    rays : sorted by intersection.
    pair : (q,) index of the common point of a model; empty for rays of all images.
    surveyed : (q,) index of the surveyed point of each intersection.
    """

    rays: ImagePoints
    pair: Ints
    surveyed: Ints


@dataclass(frozen=True, eq=False)
class PointDifferences:
    """q intersections of surveyed points next to their survey, along east, north, up at each.

    Attributes
    ----------
    surveyed : (q,) index of the surveyed point.
    x_in_local : (q, 3) intersections, metres, local frame.
    difference : (q, 3) intersected − given, metres; NaN where not known.
    survey_variance : (q, 3) of the given coordinates, m².
    in_calibration : (q,) whether it has seen them: then their errors are among the sources of ``errors``.
    errors : what makes the differences wrong.
    gsd : (q,) ground sampling distance, metres.
    rays : (q,) number of image points.
    """

    surveyed: Ints
    x_in_local: Floats
    difference: Floats
    survey_variance: Floats
    in_calibration: Bools
    errors: PointErrors
    gsd: Floats
    rays: Ints

    @property
    def by_image_points(self) -> Floats:
        """(q, 3) variance of the intersections that comes from the image coordinates, m²."""
        return np.diagonal(self.errors.by_image_points, axis1=1, axis2=2)

    @property
    def own_variance(self) -> Floats:
        """(q, 3) variance of errors that affect nothing else: image points, and survey that is new."""
        return self.by_image_points + np.where(self.in_calibration[:, None], 0.0, self.survey_variance)

    @property
    def sigma(self) -> Floats:
        """(q, 3) predicted standard deviation of the differences, metres; NaN where there is none."""
        variance = self.own_variance + self.errors.sensitivity.variance().reshape(-1, 3)
        return np.where(np.isfinite(self.difference), np.sqrt(variance), np.nan)

    def columns(self, independent: Bools) -> dict[str, np.ndarray]:
        """Columns that the tables of differences share; (k,) which surveyed points are independent."""
        names = np.array([CONTROL, INDEPENDENT], dtype=object)
        return {
            **{f"d{axis}_m": self.difference[:, k] for k, axis in enumerate(AXES)},
            **{f"sigma_d{axis}_m": self.sigma[:, k] for k, axis in enumerate(AXES)},
            "gsd_m": self.gsd,
            "rays": self.rays,
            "status": names[independent[self.surveyed].astype(np.int64)],
        }


def survey_of(oriented: DirectlyOriented, control_points: pd.DataFrame) -> SurveyedPoints:
    """The surveyed points; those known in height only take their plan position from the intersections."""
    places = map_from_local(oriented.map_frame, oriented.frame, oriented.object_point)
    near = pd.DataFrame({"point": oriented.points, **{f"{a}_m": places[:, k] for k, a in enumerate(AXES)}})
    return surveyed_points(control_points, oriented.map_frame, oriented.frame, near)


def multi_ray(oriented: DirectlyOriented, surveyed: SurveyedPoints) -> SurveyedRays:
    """All rays of every surveyed point that was intersected."""
    index = pd.Index(oriented.points).get_indexer(pd.Index(surveyed.name))
    chosen = np.flatnonzero((index >= 0) & surveyed.present.any(axis=1))
    # Intersections in the order of the points, as the rays are.
    chosen = chosen[np.argsort(index[chosen], kind="stable")]
    place = np.full(len(oriented.points), -1, dtype=np.int64)
    place[index[chosen]] = np.arange(len(chosen))
    rows = np.flatnonzero(place[oriented.rays.point] >= 0)
    rays = rays_of(oriented.rays, rows, place[oriented.rays.point[rows]])
    return SurveyedRays(rays, np.zeros(0, dtype=np.int64), chosen)


def two_rays(oriented: DirectlyOriented, surveyed: SurveyedPoints, models: ModelRays) -> SurveyedRays:
    """The two rays of every surveyed point in every model that shows it."""
    index = pd.Index(surveyed.name).get_indexer(pd.Index(np.array(oriented.points, dtype=object)))
    # With one more at the end, so that index −1 finds nothing known.
    known = np.append(surveyed.present.any(axis=1), False)
    of_pair = index[oriented.rays.point[models.common.left]]
    pairs = np.flatnonzero(known[of_pair])
    state = oriented.sources.orientations.state
    possible = intersect(_rays_of_pairs(oriented, models, pairs), state, len(pairs)).usable
    pairs = pairs[possible]
    return SurveyedRays(_rays_of_pairs(oriented, models, pairs), pairs, of_pair[pairs].astype(np.int64))


def _rays_of_pairs(oriented: DirectlyOriented, models: ModelRays, pairs: Ints) -> ImagePoints:
    rays = np.stack([models.common.left[pairs], models.common.right[pairs]], axis=1).ravel()
    return rays_of(oriented.rays, rays, np.repeat(np.arange(len(pairs)), 2))


def point_differences(
    oriented: DirectlyOriented, surveyed: SurveyedPoints, found: SurveyedRays
) -> PointDifferences:
    """Intersect the rays and compare with the survey; every intersection must be possible."""
    rays, chosen = found.rays, found.surveyed
    state = oriented.sources.orientations.state
    computed = intersect(rays, state, len(chosen)).object_point
    given = surveyed.x_in_local[chosen]
    anchor = np.where(np.isfinite(given), given, computed)
    axes = np.array(oriented.frame.local_from_enu(anchor)).reshape(-1, 3, 3)
    difference = np.einsum("qji,qj->qi", axes, computed - anchor)
    if len(chosen):
        difference[:, 2] = oriented.frame.height(computed) - surveyed.height[chosen]
    errors = point_errors(rays, oriented.sources, computed, axes)
    shared = oriented.sources.calibration.shared
    in_calibration = np.zeros(len(chosen), dtype=bool)
    if shared is not None:
        in_calibration = np.any(shared.survey_in_adjustment > 0.0, axis=1)[chosen]
        errors = _less_survey(errors, shared, np.where(in_calibration, chosen, -1))
    return PointDifferences(
        chosen,
        computed,
        np.where(surveyed.present[chosen], difference, np.nan),
        np.diagonal(surveyed.covariance[chosen], axis1=1, axis2=2),
        in_calibration,
        errors,
        _ground_sampling_distance(oriented, rays, computed),
        np.bincount(rays.point, minlength=len(chosen)).astype(np.int64),
    )


def _less_survey(errors: PointErrors, shared: SharedErrors, surveyed: Ints) -> PointErrors:
    """Errors of differences at surveyed points (q,) that the calibration has used; −1: other points."""
    seen = np.flatnonzero(surveyed >= 0)
    row, column = (3 * index[:, None, None] for index in (seen, surveyed[seen]))
    rows, columns, values = np.broadcast_arrays(
        row + np.arange(3)[:, None], column + np.arange(3), -shared.survey_spread[surveyed[seen]]
    )
    shape = (errors.sensitivity.images.shape[0], 3 * len(shared.survey_spread))
    survey = scipy.sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    return replace(errors, sensitivity=replace(errors.sensitivity, survey=scipy.sparse.csr_array(survey)))


def _ground_sampling_distance(oriented: DirectlyOriented, rays: ImagePoints, x_in_local: Floats) -> Floats:
    """(q,) pixel · depth / c, median over the images of each point, metres."""
    state = oriented.sources.orientations.state
    camera = rays.camera_of_image[rays.image]
    pixel = np.array([item.pixel_size for item in oriented.given.mountings.cameras])[camera]
    axis = state.local_from_camera[rays.image][:, :, 2]
    depth = -np.sum(axis * (x_in_local[rays.point] - state.projection_centre[rays.image]), axis=1)
    of_ray = pixel * depth / state.system[INTERIOR_ORIENTATION][camera, 0]
    medians = pd.Series(of_ray).groupby(rays.point).median()
    return np.asarray(medians.reindex(np.arange(len(x_in_local))), np.float64)
