"""Known additional parameters of a camera as values of other sets: another direction or convention."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adjust.camera.additional.conversion import NOTEWORTHY, converted
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.selection import NOTHING
from adjust.errors import AdditionalParametersError
from tasks.block.self_calibration import image_format_of
from tasks.deliveries.cameras import camera_table, frame_cameras
from tasks.errors import InputError
from tasks.files.json_text import JSON
from tasks.nearest_name import did_you_mean
from tasks.settings.cameras import CameraInput

_UM = 1e6


@dataclass(frozen=True)
class ConvertedDistortion:
    """A camera's additional parameters as values of other sets.

    Attributes
    ----------
    camera : its name.
    focal_length_mm : c, which both have.
    given, values : SET:NAME → value in its published unit, before and after.
    units : of the values after.
    largest_um, rms_um : misfit over the format, in the measured image.
    """

    camera: str
    focal_length_mm: float
    given: Mapping[str, float]
    values: Mapping[str, float]
    units: Mapping[str, str]
    largest_um: float
    rms_um: float

    @property
    def warning(self) -> str | None:
        """A sentence if the other sets cannot represent the given distortion."""
        if self.largest_um <= NOTEWORTHY * _UM:
            return None
        return (
            f"The converted distortion of camera {self.camera} differs by up to {self.largest_um:.2f} µm "
            "from the given one. Convert to more parameters, or keep the given ones."
        )

    def to_json(self) -> JSON:
        """For --json."""
        return {
            "camera": self.camera,
            "focal_length_mm": self.focal_length_mm,
            "given": dict(self.given),
            "values": dict(self.values),
            "units": dict(self.units),
            "misfit_max_um": self.largest_um,
            "misfit_rms_um": self.rms_um,
        }


def convert_distortion(
    cameras: Mapping[str, CameraInput], name: str | None, selection: str
) -> ConvertedDistortion:
    """Convert the known distortion of a camera; without a name, of the only one that has any.

    Raises
    ------
    InputError
        If there is no such camera, it brings nothing, or the parameters cannot be converted.
    """
    chosen = _chosen(cameras, name)
    table = camera_table({chosen: cameras[chosen]})
    row, camera = table.to_dict("records")[0], frame_cameras(table)[chosen]
    given, turn = cameras[chosen].additional_parameters, cameras[chosen].calibration_axes_deg
    try:
        image_format = image_format_of(row, turn)
        before = additional_parameters(NOTHING, image_format, turn, tuple(given))
        wanted = additional_parameters(selection, image_format, turn)
        values = np.array([given[item] for item in before.names])
        found = converted(before, values, wanted, camera.principal_point)
    except AdditionalParametersError as error:
        raise InputError(error.what, error.remedy, entity=f"camera {chosen}") from error
    return ConvertedDistortion(
        chosen,
        camera.focal_length * 1e3,
        dict(given),
        dict(zip(wanted.names, found.values.tolist(), strict=True)),
        dict(zip(wanted.names, wanted.units, strict=True)),
        found.largest * _UM,
        found.rms * _UM,
    )


def _chosen(cameras: Mapping[str, CameraInput], name: str | None) -> str:
    """The camera to be converted."""
    able = [item for item, camera in cameras.items() if camera.additional_parameters]
    if name is None and len(able) == 1:
        return able[0]
    if name is None:
        what = "Several cameras have" if able else "No camera has"
        remedy = (
            f"Name one by --camera: {', '.join(able)}."
            if able
            else "Give cameras.NAME.additional_parameters."
        )
        raise InputError(f"{what} additional parameters to convert.", remedy)
    if name not in cameras:
        raise InputError(f"There is no camera '{name}'.", did_you_mean(name, tuple(cameras)))
    if name not in able:
        raise InputError(
            f"Camera {name} has no additional parameters to convert.",
            f"Give cameras.{name}.additional_parameters.",
        )
    return name
