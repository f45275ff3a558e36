"""Changes of the image points by alternatives of the model, a few alternatives at a time."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.additional.register import AdditionalParameters
from adjust.camera.refraction import refracted_image_points
from adjust.observations.image_point import ImagePoints
from tasks.block.refracted_rays import coefficients_of_rays

# Image points at once: what is made of them stays in the caches of a processor.
_AT_ONCE = 8_192


def refraction(block: Block, rays: ImagePoints, interior: Floats) -> Floats:
    """By how much refraction moves the image points, (n, 2) metres.

    Parameters
    ----------
    interior : (cameras, 3) c, x0, y0.
    """
    pictures = block.approximate_state().pictures
    up = np.asarray(block.frame.local_from_enu(pictures.projection_centre))[:, :, 2]
    coefficient = coefficients_of_rays(rays, block)
    change = np.empty_like(rays.xy)
    for first in range(0, len(change), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        image, xy = rays.image[part], rays.xy[part]
        bent = refracted_image_points(
            xy,
            interior[rays.camera_of_image[image]],
            pictures.local_from_camera[image],
            up[image],
            coefficient[part],
        )
        change[part] = bent - xy
    return change


def image_errors(
    rays: ImagePoints, camera: int, principal_point: Floats, errors: AdditionalParameters
) -> list[Callable[[slice], Floats]]:
    """The effect of each of some additional parameters on computed image points of one camera.

    Each is a function of the rows (a range of them); it returns (r, 2) metres for a parameter of 1.

    Parameters
    ----------
    principal_point : (2,) of the camera, metres.
    """

    # The same rows are requested for all parameters in turn.
    @lru_cache(maxsize=1)
    def basis(first: int, last: int) -> Floats:
        own = rays.camera_of_image[rays.image[first:last]] == camera
        chosen = slice(None) if own.all() else own
        # Column after column, as they are used one by one.
        change = np.zeros((len(errors.names), last - first, 2))
        change[:, chosen] = np.moveaxis(-errors.basis(rays.xy[first:last][chosen] - principal_point), 2, 0)
        return change

    def of_parameter(k: int) -> Callable[[slice], Floats]:
        return lambda rows: basis(rows.start, rows.stop)[k]

    return [of_parameter(k) for k in range(len(errors.names))]
