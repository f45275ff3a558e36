"""Maps of the image for every variant: the mean residuals that remain, and the errors that were found.

Small drawings side by side, all with the same scale, for the first choice of control points of a sub-block.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from adjust.camera.additional.correction import correction
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.selection import NOTHING
from adjust.camera.interior import FrameCamera
from tasks.block.self_calibration import image_format_of
from tasks.deliveries.cameras import frame_cameras
from tasks.document_kit import axes, markup
from tasks.document_kit.axes import round_length
from tasks.document_kit.format_plot import FormatPlot
from tasks.document_kit.legend import arrow_scale
from tasks.documents.report.image_errors import adjusted_focal_length_mm
from tasks.documents.report.image_errors_plot import mean_rms_um
from tasks.documents.report.residual_field import (
    MARGIN,
    ResidualField,
    Vectors,
    field_vectors,
    longer_arrow,
    residual_field,
)
from tasks.quantities import is_additional
from tasks.sweep.scenario import Computed
from tasks.tables.parquet import read_table

_PANELS = 3
_UM = 1e6
_MM = 1e-3


@dataclass(frozen=True, eq=False)
class ImageMap:
    """One variant: mean residuals of a camera, and the systematic image errors taken out before.

    Attributes
    ----------
    variant : its name.
    residuals : the field of mean residuals.
    errors : −Δ of the additional parameters and of a residual grid, at the middles of the same sub-areas;
        zero where nothing was corrected.
    """

    variant: str
    residuals: ResidualField
    errors: Vectors

    @property
    def errors_rms_um(self) -> float:
        """Root mean square length of the errors, µm."""
        return float(np.sqrt(np.mean(self.errors.x_um**2 + self.errors.y_um**2)))


def image_maps(computed: Sequence[Computed], block: str) -> tuple[ImageMap, ...]:
    """The maps of a sub-block: every variant with the first choice of control points that has a result."""
    own = [one for one in computed if one.scenario.block == block and one.error is None]
    if not own:
        return ()
    first = own[0].scenario.control
    return tuple(_map_of(one) for one in own if one.scenario.control == first)


def _map_of(computed: Computed) -> ImageMap:
    """Of the first camera by name that has mean residuals."""
    tables = computed.artifacts
    grid = read_table(tables["residual_grid"])
    name = str(grid["camera"].min())
    cameras = read_table(tables["cameras"])
    camera = frame_cameras(cameras)[name]
    nothing = pd.DataFrame({"vx_um": [], "vy_um": []}, dtype=np.float64)
    field = residual_field(camera, grid[grid["camera"] == name], nothing)
    row = cameras[cameras["camera"] == name].to_dict("records")[0]
    errors = _parameter_errors_um(row, camera, field, read_table(tables["parameters"]))
    if field.correction is not None:
        given = np.stack([field.correction.x_um, field.correction.y_um], axis=-1)
        errors = errors - np.nan_to_num(given)
    return ImageMap(computed.scenario.variant, field, Vectors(errors[..., 0], errors[..., 1]))


def _parameter_errors_um(
    row: dict[object, object], camera: FrameCamera, field: ResidualField, parameters: pd.DataFrame
) -> Floats:
    """−Δ (rows, columns, 2) of the adjusted additional parameters at the middles of the sub-areas, µm.

    With a set for each flight it is the one of the first.
    """
    x, y = np.meshgrid(field.x_mm, field.y_mm)
    additional = parameters[parameters["parameter"].map(is_additional)]
    of_camera = additional[additional["camera"] == camera.name]
    if of_camera.empty:
        return np.zeros((*x.shape, 2))
    own = of_camera[of_camera["entity"] == of_camera["entity"].min()]
    turn = int(str(row["calibration_axes_deg"]))
    names = tuple(own["parameter"])
    row = row | {"focal_length_mm": adjusted_focal_length_mm(parameters, camera.name)}
    selected = additional_parameters(NOTHING, image_format_of(row, turn), turn, names)
    place = np.column_stack([x.ravel(), y.ravel()]) * _MM - np.array(camera.principal_point)
    values = own["value"].to_numpy(np.float64)
    return np.asarray(-_UM * correction(selected, values, place)).reshape(*x.shape, 2)


def residual_maps(maps: Sequence[ImageMap]) -> Markup | None:
    """Mean residuals of every variant; None where no sub-area has enough points."""
    longest = max((np.nan_to_num(one.residuals.mean.largest_um) for one in maps), default=0.0)
    if not longest > 0.0:
        return None

    def panel(one: ImageMap, plot: FormatPlot, per_um: float) -> tuple[str, list[Markup]]:
        heading = f"{one.variant}: RMS of the means {mean_rms_um(one.residuals):.2f} µm"
        return heading, field_vectors(one.residuals, one.residuals.mean, plot, per_um)

    return _panels(maps, float(longest), panel, "Mean residuals", weak=True)


def error_maps(maps: Sequence[ImageMap]) -> Markup | None:
    """Systematic image errors that each variant found; None where none found any."""
    found = [one for one in maps if one.errors_rms_um > 0.0]
    if not found:
        return None
    longest = max(one.errors.largest_um for one in found)

    def panel(one: ImageMap, plot: FormatPlot, per_um: float) -> tuple[str, list[Markup]]:
        heading = f"{one.variant}: RMS {one.errors_rms_um:.2f} µm"
        x, y = np.meshgrid(one.residuals.x_mm, one.residuals.y_mm)
        vectors = np.column_stack([one.errors.x_um.ravel(), one.errors.y_um.ravel()])
        return heading, [plot.vectors(np.column_stack([x.ravel(), y.ravel()]), vectors * per_um, "mean")]

    return _panels(found, longest, panel, "Systematic image errors", weak=False)


def _panels(
    maps: Sequence[ImageMap],
    longest_um: float,
    panel: Callable[[ImageMap, FormatPlot, float], tuple[str, list[Markup]]],
    words: str,
    *,
    weak: bool,
) -> Markup:
    """Drawings in rows of three, with the scale of the vectors below them."""
    width = (axes.WIDTH - (_PANELS + 1) * MARGIN) / _PANELS
    drawn: list[Markup] = []
    top, per_um = 0.0, 0.0
    for first in range(0, len(maps), _PANELS):
        lower = top
        for place, one in enumerate(maps[first : first + _PANELS]):
            field = one.residuals
            left = MARGIN + place * (width + MARGIN)
            plot = FormatPlot.within(field.camera.half_format, left, top + 20.0 + MARGIN, width, 420.0)
            per_um = longer_arrow(field, plot, 1.6) / longest_um
            heading, vectors = panel(one, plot, per_um)
            seams = plot.seams(field.seams_x_mm.tolist(), field.seams_y_mm.tolist())
            drawn += [markup.text(plot.left, top + 15, heading, "start", "label"), plot.frame(), seams]
            drawn += vectors
            lower = max(lower, plot.bottom)
        top = lower + MARGIN + 4.0
    length = round_length(1.5 * longest_um)
    drawn.append(arrow_scale(4.0, top + 8, length * per_um, f"{length:g} µm", "mean"))
    if weak:
        drawn.append(arrow_scale(length * per_um + 110.0, top + 8, 24.0, "not significant", "mean weak"))
    camera = maps[0].residuals.camera.name
    return markup.svg(axes.WIDTH, top + 20.0, f"{words} of camera {camera} by variant", *drawn)
