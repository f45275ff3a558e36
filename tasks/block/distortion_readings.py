"""Other readings of given additional parameters: the other direction, the other sign.

An error of the image E = measured − ideal is a function of the measured point in one direction (E = −Δ) and
of the ideal point in the other (E = D). Read in the wrong direction it is off by its change between the two
points, read with the wrong sign by 2 E.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.observations.image_point import ImagePoints
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION

# Metres in the image: no observation shows less.
_NO_CHANGE = 1e-8


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
