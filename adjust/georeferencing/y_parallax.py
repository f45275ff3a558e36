"""y-parallaxes of stereo models with given orientations.

A stereo model is a pair of successive images of a strip with the points they share. Two rays meet if they lie
in one plane with the base. In the base frame (e_x along the base B, e_z as near as possible to the mean axis
of the two cameras, e_y = e_z × e_x) a ray d through an image point, brought to the principal distance c, has
y' = −c d_y/d_z, and the y-parallax is

    p_y = y'_left − y'_right = −c (d_l × d_r)·B / (|B| (d_l·e_z)(d_r·e_z)),

zero for rays that meet. It is an error of the *relative* orientation of the two images, in the image: unlike
differences at check points it needs no survey, and it is what a stereo operator sees.

Derivatives hold the denominator: its changes are multiplied by p_y/c, some 1e-4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.georeferencing.error_sources import ErrorSources
from adjust.georeferencing.sensitivity import Sensitivity, sensitivity
from adjust.observations.base import Term
from adjust.observations.image_point import IdealRays, ImagePoints
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION, State


@dataclass(frozen=True, eq=False)
class StereoModels:
    """m pairs of images.

    Attributes
    ----------
    left, right : (m,) indices of the images, in the order of flight.
    """

    left: Ints
    right: Ints

    @property
    def count(self) -> int:
        """Number of models m."""
        return len(self.left)


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Points measured in both images of a model, model by model.

    Attributes
    ----------
    model : (q,) ascending.
    left, right : (q,) indices of the image points in the left and in the right image.
    """

    model: Ints
    left: Ints
    right: Ints


def consecutive_images(strip: Ints, order: Floats) -> StereoModels:
    """Models of successive images.

    Parameters
    ----------
    strip : (n,) images of different strips (and different cameras in one) form no model; −1: none at all.
    order : (n,) ascending along the strip, such as the time of exposure.
    """
    sequence = np.lexsort((order, strip))
    sequence = sequence[strip[sequence] >= 0]
    left, right = sequence[:-1], sequence[1:]
    follows = strip[left] == strip[right]
    return StereoModels(left[follows], right[follows])


def common_points(rays: ImagePoints, models: StereoModels) -> CommonPoints:
    """The points that were measured in both images of each model.

    An image is the left one of at most one model, so every image point has at most one partner.
    """
    images = len(rays.camera_of_image)
    model_of_left = np.full(images, -1, dtype=np.int64)
    model_of_left[models.left] = np.arange(models.count)
    # Rays are sorted by point, not necessarily by image within a point.
    order = np.lexsort((rays.image, rays.point))
    keys = rays.point[order] * images + rays.image[order]
    left = order[model_of_left[rays.image[order]] >= 0]
    model = model_of_left[rays.image[left]]
    wanted = rays.point[left] * images + models.right[model]
    place = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    found = keys[place] == wanted if len(keys) else np.zeros(0, dtype=bool)
    left, right, model = left[found], order[place[found]], model[found]
    by_model = np.argsort(model, kind="stable")
    return CommonPoints(model[by_model], left[by_model], right[by_model])


@dataclass(frozen=True, eq=False)
class YParallaxes:
    """y-parallaxes of q common points.

    Attributes
    ----------
    common : the points.
    parallax : (q,) left minus right, metres in the image.
    by_image_points : (q,) variance that comes from the image coordinates, m².
    sensitivity : of the parallaxes to all other sources.
    of_relative_orientation : (q, 5) derivatives by the elements of the relative orientation: the base along
        e_y and e_z over its length, and the rotation of the right image.
    """

    common: CommonPoints
    parallax: Floats
    by_image_points: Floats
    sensitivity: Sensitivity
    of_relative_orientation: Floats

    def variance(self) -> Floats:
        """(q,) variance of each parallax from all sources, m²."""
        return self.by_image_points + self.sensitivity.variance()


@dataclass(frozen=True, eq=False)
class _Rays:
    """One ray of each of q pairs: index of the image point, image, ray (q, 3) in camera and in local axes."""

    index: Ints
    image: Ints
    in_camera: Floats
    in_local: Floats


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Geometry of q pairs of rays.

    Attributes
    ----------
    left, right : the rays.
    base : (q, 3) from the left to the right projection centre, local axes, metres.
    e_y, e_z : (q, 3) axes of the base frame in local axes.
    scale : (q,) −c / (|B| (d_l·e_z)(d_r·e_z)).
    """

    left: _Rays
    right: _Rays
    base: Floats
    e_y: Floats
    e_z: Floats
    scale: Floats

    @cached_property
    def across(self) -> Floats:
        """(q, 3) d_l × d_r, local axes."""
        return np.cross(self.left.in_local, self.right.in_local)

    def gradients(self, local_from_camera: Floats) -> tuple[Floats, Floats]:
        """Derivatives (q, 3) of the parallaxes by the left and by the right ray, in camera axes."""
        of_left = np.cross(self.right.in_local, self.base)
        of_right = np.cross(self.base, self.left.in_local)
        left, right = (
            np.einsum("qji,qj->qi", local_from_camera[side.image], self.scale[:, None] * gradient)
            for side, gradient in ((self.left, of_left), (self.right, of_right))
        )
        return left, right


@dataclass(frozen=True, eq=False)
class _Gradients:
    """Derivatives of the parallaxes by what r rays are made of.

    The ray is (c u, −c) with c (u + d(u)) = x̄ + Δ and x̄ = x − x0: g in the ray is h = g (I + ∂d/∂u)⁻¹ in the
    measured point.

    Attributes
    ----------
    in_camera : (r, 3) the rays.
    by_ray : (r, 3) g.
    slope : (r, 2, 5) see ``IdealRays``.
    """

    in_camera: Floats
    by_ray: Floats
    slope: Floats

    @cached_property
    def by_measured(self) -> Floats:
        """(r, 2) h, by the measured point."""
        distorting = np.swapaxes(self.slope[:, :, 2:4], 1, 2) + np.eye(2)
        return np.asarray(np.linalg.solve(distorting, self.by_ray[:, :2, None])[:, :, 0])

    @property
    def by_focal_length(self) -> Floats:
        """(r,) g u − h (u + d) − g_z, by c."""
        u = -self.in_camera[:, :2] / self.in_camera[:, 2:]
        through = np.sum(self.by_ray[:, :2] * u - self.by_measured * (u + self.slope[:, :, 4]), axis=1)
        return np.asarray(through - self.by_ray[:, 2])


def y_parallaxes(rays: ImagePoints, sources: ErrorSources, common: CommonPoints) -> YParallaxes:
    """y-parallaxes of common points with the orientations of the sources, and what they come from."""
    state = sources.orientations.state
    names = () if rays.self_calibration is None else rays.self_calibration.names
    ideal = rays.straight(state, np.arange(len(names)))
    pairs = _pairs(rays, state, ideal, common)
    of_left_ray, of_right_ray = pairs.gradients(state.pictures.local_from_camera)
    of_base = pairs.scale[:, None] * pairs.across
    of_left = np.concatenate([-of_base, np.cross(pairs.left.in_camera, of_left_ray)], axis=1)
    of_right = np.concatenate([of_base, np.cross(pairs.right.in_camera, of_right_ray)], axis=1)
    gradient = np.concatenate([of_left_ray, of_right_ray])
    ray, q = np.concatenate([common.left, common.right]), len(common.model)
    of_ray = _Gradients(
        np.concatenate([pairs.left.in_camera, pairs.right.in_camera]),
        gradient,
        np.broadcast_to(ideal.slope, (len(rays.image), 2, 5))[ray],
    )
    noise = np.sum((of_ray.by_measured * rays.sigma[ray]) ** 2, axis=1)
    length = np.linalg.norm(pairs.base, axis=1)
    of_direction = [length * np.sum(of_base * axis, axis=1) for axis in (pairs.e_y, pairs.e_z)]
    errors = sensitivity(
        sources,
        q,
        np.tile(np.arange(q), 2),
        rays.image[ray],
        np.concatenate([of_left, of_right])[:, None, :],
        _system_terms(rays, ideal, ray, of_ray),
    )
    return YParallaxes(
        common,
        pairs.scale * np.sum(pairs.across * pairs.base, axis=1),
        noise[:q] + noise[q:],
        errors,
        np.column_stack([*of_direction, of_right[:, 3:]]),
    )


def _pairs(rays: ImagePoints, state: State, ideal: IdealRays, common: CommonPoints) -> _Pairs:
    """The two rays of each common point, and their base frame."""
    interior = state.system[INTERIOR_ORIENTATION][rays.camera_of_image[rays.image]]
    in_camera = np.column_stack([ideal.xy - interior[:, 1:], -interior[:, 0]])
    centre, rotation = state.pictures.projection_centre, state.pictures.local_from_camera
    in_local = np.einsum("rij,rj->ri", rotation[rays.image], in_camera)
    left, right = (
        _Rays(index, rays.image[index], in_camera[index], in_local[index])
        for index in (common.left, common.right)
    )
    base = centre[right.image] - centre[left.image]
    length = np.linalg.norm(base, axis=1)
    e_x = base / length[:, None]
    upwards = rotation[left.image, :, 2] + rotation[right.image, :, 2]
    upwards = upwards - np.sum(upwards * e_x, axis=1, keepdims=True) * e_x
    e_z = upwards / np.linalg.norm(upwards, axis=1, keepdims=True)
    depths = np.sum(left.in_local * e_z, axis=1) * np.sum(right.in_local * e_z, axis=1)
    return _Pairs(left, right, base, np.cross(e_z, e_x), e_z, -interior[common.left, 0] / (length * depths))


def _system_terms(rays: ImagePoints, ideal: IdealRays, ray: Ints, of_ray: _Gradients) -> tuple[Term, ...]:
    """Derivatives (r, 1, d) by the interior orientation and the additional parameters."""
    of_measured = of_ray.by_measured[:, None, :]
    by_principal_point = -of_measured @ (of_ray.slope[:, :, :2] + np.eye(2))
    of_interior = np.concatenate([of_ray.by_focal_length[:, None, None], by_principal_point], axis=2)
    image = rays.image[ray]
    terms = [Term(INTERIOR_ORIENTATION, rays.camera_of_image[image], of_interior)]
    if rays.self_calibration is not None:
        entity = rays.self_calibration.entity_of_image[image]
        terms.append(Term(ADDITIONAL_PARAMETERS, entity, of_measured @ ideal.basis[ray]))
    return tuple(terms)
