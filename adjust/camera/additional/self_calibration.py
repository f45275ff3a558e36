"""Corrections of measured image points, and distortion of ideal ones, by the parameters of their cameras.

Additional parameters of the cameras of a block come from a text or a set of one's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Floats, Ints, as_indices
from adjust.camera.additional.base import ParameterSet
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.evaluation import (
    Correction,
    correction_and_derivatives,
    slope_of,
    total_correction,
)
from adjust.camera.additional.forward import Distortion, undistorted
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.camera.additional.selection import SelectedTerms
from adjust.camera.interior import FrameCamera
from adjust.parameters import SystemParameters, additional_family


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """Which additional parameters each image has; :meth:`of` makes it from sets of either direction.

    Attributes
    ----------
    names : of the d components of the family, the union over all entities.
    corrections : of each of the e entities (cameras, or cameras in one flight).
    entity_of_image : (n,) index into them.
    distortions : of each of them the forward sets, functions of directions; empty where none has any.

    Raises
    ------
    ValueError : if one of the corrections is of forward direction.
    """

    names: tuple[str, ...]
    corrections: tuple[Correction, ...]
    entity_of_image: Ints
    distortions: tuple[Correction, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a distortion in the place of a correction, which has another sign and another point."""
        if any(isinstance(item, AdditionalParameters) and item.forward.any() for item in self.corrections):
            raise ValueError(
                "corrections: a set of forward direction is a distortion; use SelfCalibration.of"
            )

    @classmethod
    def of(
        cls, names: tuple[str, ...], parameters: tuple[AdditionalParameters, ...], entity_of_image: Ints
    ) -> SelfCalibration:
        """From the additional parameters of each entity, each in its direction."""
        corrections = tuple(item.only("correction") for item in parameters)
        distorted = any(item.forward.any() for item in parameters)
        distortions = tuple(Distortion.of(item) for item in parameters) if distorted else ()
        return cls(names, corrections, entity_of_image, distortions)

    @cached_property
    def forward(self) -> SelfCalibration | None:
        """The distortion alone: d(u), without unit, at directions u in the place of Δ at measured points."""
        if not self.distortions:
            return None
        return SelfCalibration(self.names, self.distortions, self.entity_of_image)

    @cached_property
    def is_linear(self) -> bool:
        """Whether Δ is the sum of functions of the measured point times the parameters, nothing else."""
        return not self.distortions and not any(item.first.any() for item in self.corrections)

    @cached_property
    def components_of_entity(self) -> tuple[Ints, ...]:
        """For each entity the indices (k,) of its parameters among the components of the family."""
        place = {name: index for index, name in enumerate(self.names)}
        return tuple(
            np.array([place[name] for name in item.names], dtype=np.int64) for item in self.corrections
        )

    def evaluate(
        self, image: Ints, reduced: Floats, values: Floats, components: Ints
    ) -> tuple[Floats, Floats]:
        """Δ (r, 2) of the parameter values (e, d), and its derivatives (r, 2, t) by t components, metres.

        Parameters
        ----------
        reduced : (r, 2) metres from the principal point.
        """
        if not len(components):
            return self.correction(image, reduced, values), np.zeros((len(reduced), 2, 0))
        if len(self.corrections) == 1 and np.array_equal(self.components_of_entity[0], components):
            return correction_and_derivatives(self.corrections[0], reduced, values[0, components])
        correction, basis = np.zeros((len(reduced), 2)), np.zeros((len(reduced), 2, len(components)))
        slot = np.full(len(self.names), -1, dtype=np.int64)
        slot[components] = np.arange(len(components))
        for entity, rows in self._rows(image):
            own = self.components_of_entity[entity]
            if not len(own):
                continue
            to = slot[own]
            correction[rows], of_entity = correction_and_derivatives(
                self.corrections[entity], reduced[rows], values[entity, own]
            )
            part = np.zeros((len(of_entity), 2, len(components)))
            part[:, :, to[to >= 0]] = of_entity[:, :, to >= 0]
            basis[rows] = part
        return correction, basis

    def correction(self, image: Ints, reduced: Floats, values: Floats) -> Floats:
        """Δ (r, 2), metres, of the parameter values (e, d) at points (r, 2) from the principal point."""
        result = np.zeros((len(reduced), 2))
        for entity, rows in self._rows(image):
            own = values[entity, self.components_of_entity[entity]]
            result[rows] = total_correction(self.corrections[entity], reduced[rows], own)
        return result

    def slope(self, image: Ints, reduced: Floats, values: Floats) -> Floats:
        """∂Δ/∂(x̄, ȳ) (r, 2, 2); within a tile where Δ jumps at seams."""
        return slope_of(lambda xy: self.correction(image, xy, values), reduced)

    def undistorted(self, image: Ints, distorted: Floats, values: Floats) -> Floats:
        """Directions u (r, 2) with u + d(u) as given (r, 2); of a model of the distortion alone."""
        result = np.empty_like(distorted)
        for entity, rows in self._rows(image):
            own = values[entity, self.components_of_entity[entity]]
            result[rows], _ = undistorted(self.corrections[entity], distorted[rows], own)
        return result

    def _rows(self, image: Ints) -> list[tuple[int, Ints | slice]]:
        """Every entity that occurs, and the rows of its image points."""
        if len(self.corrections) == 1:
            return [(0, slice(None))]
        entity = self.entity_of_image[image]
        return [(int(index), np.flatnonzero(entity == index)) for index in np.unique(entity)]


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
