"""Systematic image errors: the effect of the adjusted additional parameters on the image, −Δ over the format.

The values are those of ``parameters.parquet``: besides what was adjusted also what the camera brought along.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.bluh_tiles import tiles_of
from adjust.camera.additional.calibration_axes import calibration_from_image
from adjust.camera.additional.correction import correction
from adjust.camera.additional.effect import image_error_field
from adjust.camera.additional.register import REGISTER, AdditionalParameters, additional_parameters
from adjust.camera.additional.selection import NOTHING, selected_items
from adjust.camera.interior import FrameCamera
from tasks.block.self_calibration import image_format_of
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.material import Material
from tasks.quantities import is_additional

# Points of the numbers and, along the longer side, of the drawings.
_FINE = 201
_DRAWN_ACROSS = 27
_TILES_OF_BLUH = tuple(f"bluh:{number}" for number in range(42, 74))
_UM = 1e6
_MM = 1e3
ALL = "all"


@dataclass(frozen=True, eq=False)
class PartOfErrors:
    """The systematic image error of some parameters.

    Attributes
    ----------
    title : what was selected, such as ``bluh:1–12``, or ``all``.
    at_mm : (n, 2) points of the drawing, the middles of equal cells of the format, image axes.
    error_um : (n, 2) the error there.
    largest_um, rms_um : of its length over the whole format, from a dense grid.
    """

    title: str
    at_mm: Floats
    error_um: Floats
    largest_um: float
    rms_um: float

    @property
    def longest_um(self) -> float:
        """Length of the longest error that is drawn."""
        return float(np.hypot(*self.error_um.T).max())


@dataclass(frozen=True, eq=False)
class ImageErrors:
    """The systematic image errors of a camera, or of a camera in one flight.

    Attributes
    ----------
    entity : which.
    camera : whose format it is.
    all : of all parameters together.
    parts : of each part of the selection; empty where it has one only.
    seams_x_mm, seams_y_mm : lines x = constant and y = constant where CCD images meet, image axes.
    spacing_mm : distance of the points of the drawing.
    """

    entity: str
    camera: FrameCamera
    all: PartOfErrors
    parts: tuple[PartOfErrors, ...]
    seams_x_mm: tuple[float, ...]
    seams_y_mm: tuple[float, ...]
    spacing_mm: float


def additional_of(material: Material) -> pd.DataFrame:
    """The rows of parameters.parquet that are additional parameters."""
    return material.parameters[material.parameters["parameter"].map(is_additional)]


def parameters_of(material: Material, camera: str, names: tuple[str, ...]) -> AdditionalParameters:
    """The effect of these parameters on the images of a camera, with its adjusted focal length."""
    table = material.camera_table
    row = table[table["camera"] == camera].to_dict("records")[0]
    row["focal_length_mm"] = adjusted_focal_length_mm(material.parameters, camera)
    turn = int(str(row["calibration_axes_deg"]))
    return additional_parameters(NOTHING, image_format_of(row, turn), turn, names)


def adjusted_focal_length_mm(parameters: pd.DataFrame, camera: str) -> float:
    """Focal length of a camera from parameters.parquet, which also lists held parameters."""
    own = parameters[(parameters["parameter"] == "focal_length") & (parameters["entity"] == camera)]
    return float(own["value"].item())


def image_errors(material: Material) -> tuple[ImageErrors, ...]:
    """Of every entity with additional parameters, by name; empty without self-calibration."""
    if material.self_calibration.empty:
        return ()
    return tuple(
        _errors_of(material, str(entity), own)
        for entity, own in additional_of(material).groupby("entity", sort=True)
    )


def _errors_of(material: Material, entity: str, own: pd.DataFrame) -> ImageErrors:
    name = str(own["camera"].iloc[0])
    camera = material.cameras[name]
    half = np.array(camera.half_format)
    columns, rows = np.maximum(np.round(_DRAWN_ACROSS * half / half.max()), 3).astype(int)
    at = _middles(half, int(columns), int(rows))
    values = dict(zip(own["parameter"], own["value"].astype(np.float64), strict=True))

    def part(title: str, names: tuple[str, ...]) -> PartOfErrors:
        parameters, adjusted = parameters_of(material, name, names), np.array([values[n] for n in names])
        dense = image_error_field(parameters, adjusted, _FINE, _FINE)
        error_um = -_UM * correction(parameters, adjusted, at)
        return PartOfErrors(title, at * _MM, error_um, dense.largest * _UM, dense.rms * _UM)

    names = tuple(values)
    items = selected_items(material.project.adjustment.self_calibration.parameters, REGISTER)
    parts = tuple(part(item.title, tuple(f"{item.set.name}:{name}" for name in item.names)) for item in items)
    seams_x, seams_y = _seams(parameters_of(material, name, names), names)
    return ImageErrors(
        entity,
        camera,
        part(ALL, names),
        parts if len(parts) > 1 else (),
        seams_x,
        seams_y,
        float(2.0 * half.min() * _MM / min(columns, rows)),
    )


def _middles(half: Floats, columns: int, rows: int) -> Floats:
    """Middles (columns · rows, 2) of equal cells of a format with half sides (x, y), metres."""
    x, y = (h * ((np.arange(n) + 0.5) / n * 2.0 - 1.0) for h, n in zip(half, (columns, rows), strict=True))
    return np.stack([axis.ravel() for axis in np.meshgrid(x, y)], axis=1)


def _seams(parameters: AdditionalParameters, names: tuple[str, ...]) -> tuple[tuple[float, ...], ...]:
    """Lines x = constant and y = constant between CCD images, mm in image axes; none where none are known."""
    given: ImageFormat = parameters.image_format
    tiles = given.tiles
    if tiles is None and set(names) & set(_TILES_OF_BLUH):
        tiles = tiles_of(given)
    if tiles is None:
        return (), ()
    image_from_calibration = calibration_from_image(parameters.turn_deg).T
    lines: tuple[list[float], list[float]] = ([], [])
    for axis, seams in enumerate((tiles.seams_x, tiles.seams_y)):
        to = int(np.flatnonzero(image_from_calibration[:, axis])[0])
        lines[to].extend(_MM * seam * float(image_from_calibration[to, axis]) for seam in seams)
    return tuple(tuple(sorted(own)) for own in lines)


def errors_table(errors: tuple[ImageErrors, ...]) -> Table:
    """Root mean square and largest systematic image error, of all and of each part of the selection."""
    columns = (
        text_column("entity", "of"),
        text_column("part", "parameters"),
        Column("rms_um", "RMS", "µm"),
        Column("largest_um", "largest", "µm"),
        Column("rms_px", "RMS", "px"),
        Column("largest_px", "largest", "px"),
    )
    rows = []
    for own in errors:
        pixel_um = own.camera.pixel_size * _UM
        for part in (own.all, *own.parts):
            um = (part.rms_um, part.largest_um)
            cells: tuple[Any, ...] = (*numbers(um, 2), *numbers((v / pixel_um for v in um), 3))
            rows.append(Row(f"{part.title}@{own.entity}", (own.entity, part.title, *cells)))
    return Table("image-errors", "Systematic image errors over the format", columns, tuple(rows))


def correction_um(material: Material, points: pd.DataFrame) -> Floats:
    """Change of the correction Δ by the adjustment (n, 2), µm, at image points (rows of image_residuals)."""
    result = np.zeros((len(points), 2))
    images = material.images
    flights = points["image"].map(dict(zip(images["image"], images["flight"].fillna(""), strict=True)))
    for _, own in additional_of(material).groupby("entity", sort=True):
        name, flight = own["camera"].iloc[0], own["flight"].iloc[0]
        in_flight = flights == flight if isinstance(flight, str) else True
        rows = np.flatnonzero((points["camera"] == name) & in_flight)
        principal_point = np.array(material.cameras[name].principal_point)
        xy = points[["x_mm", "y_mm"]].to_numpy(np.float64)[rows] / _MM - principal_point
        parameters = parameters_of(material, name, tuple(own["parameter"]))
        value = own["value"].to_numpy(np.float64)
        for sign, values in ((1.0, value), (-1.0, value - own["change"].to_numpy(np.float64))):
            result[rows] += sign * _UM * correction(parameters, values, xy)
    return result
