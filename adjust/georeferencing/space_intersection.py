"""Space intersection from directly georeferenced images, with its rigorous covariance.

The rays of a point are intersected by least squares with the weights of their image coordinates. With the
derivatives A_X, A_EO, A_p of the collinearity equations,

    dX = −(A_Xᵀ P A_X)⁻¹ A_Xᵀ P (A_EO dEO + A_p dp − dl),

so besides (A_Xᵀ P A_X)⁻¹, the part of the image coordinates, the covariance has parts from the orientations
and the calibration, which are not in the weights and are common to many points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.georeferencing.error_sources import ErrorSources
from adjust.georeferencing.sensitivity import Sensitivity, sensitivity
from adjust.observations.base import Term
from adjust.observations.image_point import ImagePoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors of m intersected points, along given axes at each point.

    Attributes
    ----------
    by_image_points : (m, 3, 3) covariance that comes from the image coordinates, m².
    sensitivity : of the 3 m coordinates to all other sources; point i has the rows 3 i, 3 i + 1, 3 i + 2.
    """

    by_image_points: Floats
    sensitivity: Sensitivity

    def covariance(self) -> Floats:
        """Covariance (m, 3, 3) of each point from all sources, m²."""
        matrix = self.sensitivity.matrix()
        result = self.by_image_points.copy()
        for a in range(3):
            for b in range(a, 3):
                products = np.asarray(matrix[a::3].multiply(matrix[b::3]).sum(axis=1)).ravel()
                result[:, a, b] += products
                if a != b:
                    result[:, b, a] += products
        return result


def point_errors(rays: ImagePoints, sources: ErrorSources, object_point: Floats, axes: Floats) -> PointErrors:
    """Errors of intersected points.

    Parameters
    ----------
    rays : the image points they were intersected from, at least two of every point.
    object_point : (m, 3) the intersections, metres, local frame.
    axes : (m, 3, 3) local from the axes at each point in which errors are wanted.
    """
    m = len(object_point)
    equations = rays.linearize(replace(sources.orientations.state, object_point=object_point))
    of = {term.block: term for term in equations.terms}
    of_point, of_orientation = of.pop(OBJECT_POINT).jacobian, of.pop(EXTERIOR_ORIENTATION).jacobian
    weighted = np.swapaxes(of_point * (rays.inverse_sigma**2)[:, :, None], 1, 2)
    normal = np.zeros((m, 3, 3))
    np.add.at(normal, rays.point, weighted @ of_point)
    cofactor = np.asarray(np.linalg.inv(normal), np.float64)
    along = np.swapaxes(axes, 1, 2)
    # Along the axes wanted, dX for a misclosure of each ray.
    gain = along[rays.point] @ cofactor[rays.point] @ weighted
    system = tuple(Term(term.block, term.index, -gain @ term.jacobian) for term in of.values())
    return PointErrors(
        along @ cofactor @ axes,
        sensitivity(sources, m, rays.point, rays.image, -gain @ of_orientation, system),
    )


def rays_of(rays: ImagePoints, index: Ints, point: Ints) -> ImagePoints:
    """Some of the image points (r,), as rays of other points: indices (r,), ascending."""
    return replace(
        rays,
        image=rays.image[index],
        point=point,
        xy=rays.xy[index],
        sigma=rays.sigma[index],
        active=rays.active[index],
        offset=None if rays.offset is None else rays.offset[index],
    )
