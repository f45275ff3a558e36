"""Additional parameters of the cameras of a block, from a text or a set of one's own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import as_indices
from adjust.camera.additional.base import ParameterSet
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.camera.additional.selection import SelectedTerms
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.parameters import SystemParameters, additional_family


def self_calibration(
    cameras: Sequence[FrameCamera],
    camera_of_image: ArrayLike,
    selection: str | ParameterSet,
    turn_deg: int = 0,
) -> tuple[SelfCalibration, SystemParameters]:
    """Additional parameters that every camera has: the model for image points, the unknowns for the block.

    All of them are zero and free. Other values, and which are free, are given by ``dataclasses.replace`` of
    the arrays (cameras, parameters) of the second.

    Parameters
    ----------
    cameras : those of the block, in its order.
    camera_of_image : (n,) index into them.
    selection : such as ``brown-forward:k1-k3,p1,p2``, see ``docs/additional-parameters.md``; or a set.
    turn_deg : 0, 90, 180 or 270, counter-clockwise from the image axes to those a set is defined in.

    Raises
    ------
    AdditionalParametersError : if the text names what does not exist, or one parameter twice.
    """
    of_camera = tuple(_of_camera(camera, selection, turn_deg) for camera in cameras)
    names, units = of_camera[0].names, of_camera[0].units
    image = as_indices("camera_of_image", camera_of_image, np.size(camera_of_image))
    shape = (len(cameras), len(names))
    parameters = SystemParameters(
        additional_family(names, units),
        tuple(camera.name for camera in cameras),
        np.zeros(shape),
        np.ones(shape, dtype=bool),
    )
    return SelfCalibration.of(names, of_camera, image), parameters


def _of_camera(camera: FrameCamera, selection: str | ParameterSet, turn_deg: int) -> AdditionalParameters:
    image_format = format_in_calibration_axes(camera.half_format, turn_deg, focal_length=camera.focal_length)
    if isinstance(selection, str):
        return additional_parameters(selection, image_format, turn_deg)
    terms = SelectedTerms(selection, tuple(selection.terms_in(image_format)))
    return AdditionalParameters((terms,), image_format, turn_deg)
