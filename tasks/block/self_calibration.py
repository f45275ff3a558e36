"""The additional parameters of a block, from its cameras and the settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.additional.base import ImageFormat, Tiles
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.conversion import refuse_folded
from adjust.camera.additional.effect import effects
from adjust.camera.additional.register import REGISTER, AdditionalParameters, additional_parameters
from adjust.camera.additional.selection import NOTHING, selected
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import AdditionalParametersError
from adjust.observations.base import StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.parameters import SystemParameters, additional_family
from tasks.block.given_orientations import GivenOrientations
from tasks.errors import InputError
from tasks.files.json_text import from_json
from tasks.settings.adjustment import SelfCalibrationSettings

_MM = 1e-3
_UM = 1e-6


@dataclass(frozen=True, eq=False)
class CalibratedImages:
    """Which camera took each of n images in which flight.

    Attributes
    ----------
    cameras, flights : names.
    camera, flight : (n,) index into them.
    """

    cameras: tuple[str, ...]
    camera: Ints
    flights: tuple[str, ...]
    flight: Ints


@dataclass(frozen=True, eq=False)
class BlockSelfCalibration:
    """Additional parameters of a block.

    Attributes
    ----------
    model : which parameters each image has.
    of_entity : the same, entity by entity, corrections and distortions together.
    parameters : their given values and which are free, one row for each entity.
    largest_effect, rms_effect : (e, d) of the correction over the image for a unit of each, metres; NaN
        where an entity does not have the parameter.
    """

    model: SelfCalibration
    of_entity: tuple[AdditionalParameters, ...]
    parameters: SystemParameters
    largest_effect: Floats
    rms_effect: Floats

    def prior(self, sigma_um: float | None) -> DirectObservations | None:
        """Direct observations of the free parameters, with effects of so many µm; None without."""
        free: Bools = self.parameters.free
        if sigma_um is None or not free.any():
            return None
        with np.errstate(divide="ignore"):
            sigma = np.where(free, sigma_um * _UM / self.largest_effect, np.nan)
        entities = np.arange(len(self.parameters.entities), dtype=np.int64)
        return DirectObservations(
            self.parameters.family, entities, self.parameters.values, StochasticModel.from_sigma(sigma)
        )


def block_self_calibration(
    given: GivenOrientations, cameras: pd.DataFrame, settings: SelfCalibrationSettings
) -> BlockSelfCalibration | None:
    """The additional parameters the settings free, and those the cameras bring along; None without any.

    Parameters
    ----------
    cameras : cameras.parquet.

    Raises
    ------
    InputError
        If a camera brings a parameter that is not known.
    """
    cameras = cameras.set_index("camera").loc[list(given.mountings.names)].reset_index()
    known = [from_json(str(text)) for text in cameras["additional_parameters"]]
    if settings.parameters == NOTHING and not any(known):
        return None
    of_camera = [
        _corrections(row, settings.parameters, values)
        for row, values in zip(cameras.to_dict("records"), known, strict=True)
    ]
    images = CalibratedImages(given.mountings.names, given.camera, given.flights, given.flight_of_image)
    return self_calibration_of(images, of_camera, known, settings)


def self_calibration_of(
    images: CalibratedImages,
    of_camera: Sequence[AdditionalParameters],
    known: Sequence[Mapping[str, float]],
    settings: SelfCalibrationSettings,
) -> BlockSelfCalibration:
    """The additional parameters of images whose cameras have them.

    Parameters
    ----------
    of_camera, known : of every camera its parameters, and the values that are given of them.
    """
    free_names = set(_names_of(settings.parameters))
    camera_of_entity, flights, entity_of_image = _entities(images, settings.per)
    entities = tuple(images.cameras[camera] for camera in camera_of_entity)
    units = {n: u for item in of_camera for n, u in zip(item.names, item.units, strict=True)}
    names = tuple(units)
    values = np.zeros((len(entities), len(names)))
    free = np.zeros(values.shape, dtype=bool)
    largest, rms = np.full(values.shape, np.nan), np.full(values.shape, np.nan)
    for entity, camera in enumerate(camera_of_entity):
        correction = of_camera[camera]
        place, effect = {name: k for k, name in enumerate(correction.names)}, effects(correction)
        for column, name in enumerate(names):
            if name in place:
                values[entity, column] = known[camera].get(name, 0.0)
                free[entity, column] = name in free_names
                largest[entity, column] = effect.largest[place[name]]
                rms[entity, column] = effect.rms[place[name]]
    of_entity = tuple(of_camera[camera] for camera in camera_of_entity)
    return BlockSelfCalibration(
        SelfCalibration.of(names, of_entity, entity_of_image),
        of_entity,
        SystemParameters(additional_family(names, tuple(units.values())), entities, values, free, flights),
        largest,
        rms,
    )


def _names_of(selection: str) -> tuple[str, ...]:
    parts = selected(selection, REGISTER)
    return tuple(f"{part.set.name}:{name}" for part in parts for name in part.names)


def _corrections(
    camera: dict[object, object], selection: str, known: dict[str, float]
) -> AdditionalParameters:
    """All parameters of one camera: those selected, then those it brings along besides."""
    besides = tuple(name for name in known if name not in _names_of(selection))
    turn = int(str(camera["calibration_axes_deg"]))
    name = str(camera["camera"])
    found = additional_parameters_of(name, selection, image_format_of(camera, turn), turn, besides)
    values = np.array([known.get(item, 0.0) for item in found.names])
    principal_point = np.array([float(str(camera[f"principal_point_{axis}_mm"])) * _MM for axis in "xy"])
    try:
        refuse_folded(found, values, principal_point)
    except AdditionalParametersError as error:
        raise InputError(error.what, error.remedy, entity=f"camera {name}") from error
    return found


def additional_parameters_of(
    camera: str, selection: str, image_format: ImageFormat, turn_deg: int, besides: tuple[str, ...] = ()
) -> AdditionalParameters:
    """The selected parameters of a camera, then those it brings along besides.

    Raises
    ------
    InputError
        If the camera cannot have them.
    """
    try:
        return additional_parameters(selection, image_format, turn_deg, besides)
    except AdditionalParametersError as error:
        raise InputError(
            f"The additional parameters cannot be used with this camera: {error}",
            "Choose others in adjustment.self_calibration, or complete the camera.",
            entity=f"camera {camera}",
        ) from error


def image_format_of(camera: dict[object, object], turn: int) -> ImageFormat:
    """The image of a camera (a row of cameras.parquet) in calibration axes."""
    pixel = float(str(camera["pixel_um"])) * _UM
    half = (0.5 * int(str(camera["columns"])) * pixel, 0.5 * int(str(camera["rows"])) * pixel)
    focal_length = float(str(camera["focal_length_mm"])) * _MM
    layout = camera["tiles"]
    if not isinstance(layout, str):
        return format_in_calibration_axes(half, turn, focal_length=focal_length)
    given = from_json(layout)
    tiles = Tiles(
        tuple(seam * _MM for seam in given["seams_x_mm"]),
        tuple(seam * _MM for seam in given["seams_y_mm"]),
        given["blend_mm"] * _MM,
        given["perspective"],
    )
    return format_in_calibration_axes(half, turn, tiles, focal_length)


def _entities(images: CalibratedImages, per: str) -> tuple[tuple[int, ...], tuple[str, ...] | None, Ints]:
    """Camera and flight of every entity, and the entity of every image; flights None: one set a camera."""
    if per == "camera":
        return tuple(range(len(images.cameras))), None, images.camera
    count = len(images.flights)
    present, entity_of_image = np.unique(images.camera * count + images.flight, return_inverse=True)
    cameras = tuple(int(pair) // count for pair in present)
    flights = tuple(images.flights[int(pair) % count] for pair in present)
    return cameras, flights, entity_of_image.astype(np.int64)
