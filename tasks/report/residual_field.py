"""Mean image residuals in sub-areas of the format: what is left of systematic image errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.interior import FrameCamera
from tasks.report import axes, markup
from tasks.report.axes import Scale, round_length
from tasks.report.legend import arrow_scale
from tasks.report.material import Material
from tasks.report.table import Column, Row, Table, numbers, text_column

_MOST_CELLS = 25
_AIM_PER_CELL = 25
# A mean of fewer residuals says too little to be drawn.
LEAST_IN_CELL = 5
# χ² with two degrees of freedom, 95 %.
_CHI2_95 = 5.991
_MM = 1e3


@dataclass(frozen=True, eq=False)
class ResidualField:
    """Mean residuals of one camera in equal cells of its format; arrays (rows, columns), row 0 at the bottom.

    Attributes
    ----------
    camera : the camera.
    x_mm, y_mm : (columns,), (rows,) middles of the cells.
    vx_um, vy_um : means, µm; NaN in cells with fewer than ``LEAST_IN_CELL`` image points.
    count : number of image points.
    significant : the mean vector differs from zero at 95 %, with the scatter of all residuals of the camera.
    rms_um : (2,) root mean square of all its residuals x, y.
    """

    camera: FrameCamera
    x_mm: Floats
    y_mm: Floats
    vx_um: Floats
    vy_um: Floats
    count: Ints
    significant: Bools
    rms_um: tuple[float, float]

    @property
    def drawn(self) -> Bools:
        """(rows, columns) whether a cell has enough points."""
        return np.isfinite(self.vx_um)

    @property
    def largest_um(self) -> float:
        """Length of the longest mean vector, µm; NaN without any."""
        length = np.hypot(self.vx_um, self.vy_um)[self.drawn]
        return float(length.max()) if len(length) else float("nan")


def residual_fields(material: Material) -> tuple[ResidualField, ...]:
    """The field of every camera with image points that took part, by name."""
    table = material.image_residuals
    used = table[table["used"]]
    return tuple(
        residual_field(material.cameras[str(name)], own) for name, own in used.groupby("camera", sort=True)
    )


def residual_field(camera: FrameCamera, table: pd.DataFrame) -> ResidualField:
    """The field of one camera from its image points (x_mm, y_mm, vx_um, vy_um)."""
    side = int(np.clip(np.sqrt(len(table) / _AIM_PER_CELL), 1, _MOST_CELLS))
    half_x, half_y = (half * _MM for half in camera.half_format)
    column = _cell(table["x_mm"].to_numpy(np.float64), half_x, side)
    row = _cell(table["y_mm"].to_numpy(np.float64), half_y, side)
    cell = row * side + column
    v = table[["vx_um", "vy_um"]].to_numpy(np.float64)
    count = np.bincount(cell, minlength=side * side)
    sums = [np.bincount(cell, weights=v[:, k], minlength=side * side) for k in (0, 1)]
    enough = count >= LEAST_IN_CELL
    mean = np.array([np.where(enough, s / np.maximum(count, 1), np.nan) for s in sums])
    square = np.mean(v**2, axis=0)
    statistic = count * np.sum(mean**2 / np.maximum(square, 1e-12)[:, None], axis=0)
    middles = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    shape = (side, side)
    return ResidualField(
        camera,
        middles * half_x,
        middles * half_y,
        mean[0].reshape(shape),
        mean[1].reshape(shape),
        count.reshape(shape).astype(np.int64),
        (np.nan_to_num(statistic) > _CHI2_95).reshape(shape),
        (float(np.sqrt(square[0])), float(np.sqrt(square[1]))),
    )


def _cell(values_mm: Floats, half_mm: float, side: int) -> Ints:
    """Number of the cell along one axis; what lies on or beyond the border belongs to the outermost one."""
    return np.clip(np.floor((values_mm + half_mm) / (2.0 * half_mm) * side), 0, side - 1).astype(np.int64)


def field_plot(field: ResidualField) -> Markup:
    """Vectors of the mean residuals over the format, with a scale arrow."""
    half_x, half_y = (half * _MM for half in field.camera.half_format)
    left, top = 70.0, 10.0
    unit = min((axes.WIDTH - left - 12.0) / (2 * half_x), 640.0 / (2 * half_y))
    left += 0.5 * (axes.WIDTH - left - 12.0 - 2 * half_x * unit)
    x = Scale(-half_x, half_x, left, left + 2 * half_x * unit)
    y = Scale(-half_y, half_y, top + 2 * half_y * unit, top)
    parts = [
        axes.horizontal_axis(x, top, y.start, "x of the image [mm]"),
        axes.vertical_axis(y, x.start, x.end, "y of the image [mm]"),
        axes.frame(x.start, top, x.end, y.start),
    ]
    bottom = y.start + 52
    if field.largest_um > 0.0:
        cell = min(2 * half_x, 2 * half_y) * unit / len(field.x_mm)
        per_um = min(max(0.95 * cell, 14.0), 60.0) / field.largest_um
        parts += _vectors(field, x, y, per_um)
        length = round_length(1.5 * field.largest_um)
        parts.append(arrow_scale(x.start, bottom + 6, length * per_um, f"{length:g} µm", "mean"))
        shift = x.start + length * per_um + 100
        parts.append(arrow_scale(shift, bottom + 6, 24.0, "not significant (95 %)", "mean weak"))
        bottom += 22
    return markup.svg(axes.WIDTH, bottom, f"Mean residuals of camera {field.camera.name}", *parts)


def _vectors(field: ResidualField, x: Scale, y: Scale, per_um: float) -> list[Markup]:
    """One path each for the significant vectors and the others."""
    paths = []
    for css, chosen in (
        ("mean weak", field.drawn & ~field.significant),
        ("mean", field.drawn & field.significant),
    ):
        data = "".join(
            markup.arrow(
                x.at(float(field.x_mm[c])),
                y.at(float(field.y_mm[r])),
                float(field.vx_um[r, c]) * per_um,
                -float(field.vy_um[r, c]) * per_um,
                4.0,
            )
            for r, c in np.argwhere(chosen)
        )
        if data:
            paths.append(markup.element("path", {"class": css, "d": data}))
    return paths


def field_table(fields: tuple[ResidualField, ...]) -> Table:
    """Figures of the residuals of each camera."""
    columns = (
        text_column("camera", "camera"),
        Column("image_points", "image points"),
        Column("rms_x_um", "RMS x", "µm"),
        Column("rms_y_um", "RMS y", "µm"),
        Column("rms_x_px", "RMS x", "px"),
        Column("rms_y_px", "RMS y", "px"),
        Column("cells", "sub-areas drawn"),
        Column("significant", "of them significant"),
        Column("largest_um", "largest mean", "µm"),
    )
    rows = []
    for field in fields:
        pixel_um = field.camera.pixel_size * 1e6
        rows.append(
            Row(
                field.camera.name,
                (
                    field.camera.name,
                    *numbers((float(field.count.sum()),), 0),
                    *numbers(field.rms_um, 2),
                    *numbers((v / pixel_um for v in field.rms_um), 3),
                    *numbers((float(field.drawn.sum()), float(field.significant.sum())), 0),
                    *numbers((field.largest_um,), 2),
                ),
            )
        )
    return Table("image-residuals", "Image residuals by camera", columns, tuple(rows))
