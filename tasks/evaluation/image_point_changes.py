"""Changes of the image points by alternatives of the model, a few alternatives at a time.

Given additional parameters may be meant otherwise: in the other direction, with the other sign. An error of
the image E = measured − ideal is a function of the measured point in one direction (E = −Δ) and of the ideal
point in the other (E = D). Read in the wrong direction it is off by its change between the two points, read
with the wrong sign by 2 E.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.additional.register import AdditionalParameters
from adjust.camera.refraction import refracted_image_points
from adjust.observations.image_point import ImagePoints
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION
from tasks.block.refracted_rays import coefficients_of_rays

# Image points at once: what is made of them stays in the caches of a processor.
_AT_ONCE = 8_192
# Metres in the image: no observation shows less.
_NO_CHANGE = 1e-8


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


def other_readings(block: Block, rays: ImagePoints) -> Iterator[tuple[str, str, Floats]]:
    """Quantity, entity and change (n, 2) of the computed image points, of values that are held and not zero.

    Parameters
    ----------
    block : with the adjusted values.
    """
    model = rays.self_calibration
    if model is None:
        return
    parameters = next(item for item in block.system if item.family.name == ADDITIONAL_PARAMETERS)
    held = np.where(parameters.free, 0.0, parameters.values)
    state, image = block.approximate_state(), rays.image
    interior = state.system[INTERIOR_ORIENTATION][rays.camera_of_image[image]]
    c, principal_point = interior[:, :1], interior[:, 1:]
    measured = rays.xy - principal_point
    ideal = rays.straight(state, np.zeros(0, dtype=np.int64)).xy - principal_point
    sign = 2.0 * model.correction(image, measured, held)
    direction = model.correction(image, measured, held) - model.correction(image, ideal, held)
    if model.forward is not None:
        at_ideal, at_measured = (
            c * model.forward.correction(image, at / c, held) for at in (ideal, measured)
        )
        sign, direction = sign - 2.0 * at_ideal, direction + at_measured - at_ideal
    entity = model.entity_of_image[image]
    for number in range(len(parameters.entities)):
        for quantity, change in (("distortion_direction", direction), ("distortion_sign", sign)):
            own = np.where((entity == number)[:, None], change, 0.0)
            if np.abs(own).max(initial=0.0) > _NO_CHANGE:
                yield quantity, parameters.quantity(number, 0).entity, own
