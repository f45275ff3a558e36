"""Mean image residuals in sub-areas of the format, and corrections by them, from residual_grid.parquet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Bools, Floats
from adjust.camera.interior import FrameCamera
from adjust.residual_grid.residual_grid import residual_grid
from tasks.block.residual_grid_cells import residual_grid_cells
from tasks.document_kit import axes, markup
from tasks.document_kit.axes import round_length
from tasks.document_kit.format_plot import FormatPlot
from tasks.document_kit.legend import arrow_scale
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Table
from tasks.documents.report.material import Material

#: Room around each of several plots in a drawing, for arrows that lead out of them.
MARGIN = 36.0
_MM = 1e3


@dataclass(frozen=True, eq=False)
class Vectors:
    """Vectors in the sub-areas; arrays (rows, columns), µm, NaN where there is none."""

    x_um: Floats
    y_um: Floats

    @property
    def drawn(self) -> Bools:
        """(rows, columns) whether a coordinate is known at least; the other one then counts as zero."""
        return np.asarray(np.isfinite(self.x_um) | np.isfinite(self.y_um))

    @property
    def largest_um(self) -> float:
        """Length of the longest vector, µm; NaN without any."""
        length = np.hypot(np.nan_to_num(self.x_um), np.nan_to_num(self.y_um))[self.drawn]
        return float(length.max()) if len(length) else float("nan")


@dataclass(frozen=True, eq=False)
class ResidualField:
    """Mean residuals of one camera; arrays (rows, columns), row 0 at the bottom.

    Attributes
    ----------
    camera : the camera.
    x_mm, y_mm : (columns,), (rows,) middles of the sub-areas.
    seams_x_mm, seams_y_mm : where CCD images meet.
    mean : mean residuals.
    correction : what was added to the image coordinates before; None where nothing was.
    significant : the mean vector differs from zero.
    image_points : of the camera that were used with both coordinates.
    rms_um : (2,) root mean square of all their residuals x, y.
    """

    camera: FrameCamera
    x_mm: Floats
    y_mm: Floats
    seams_x_mm: Floats
    seams_y_mm: Floats
    mean: Vectors
    correction: Vectors | None
    significant: Bools
    image_points: int
    rms_um: tuple[float, float]

    @property
    def longest_um(self) -> float:
        """Length of the longest vector of both kinds, µm: they are drawn at the same scale."""
        lengths = [self.mean.largest_um, *([] if self.correction is None else [self.correction.largest_um])]
        return float(np.nanmax([0.0, *lengths]))


def residual_fields(material: Material) -> tuple[ResidualField, ...]:
    """The field of every camera with image points that were used, by name."""
    table = material.image_residuals
    return tuple(
        residual_field(
            material.cameras[str(name)],
            own,
            table.loc[table["used"] & (table["camera"] == name), ["vx_um", "vy_um"]],
        )
        for name, own in material.residual_grid.groupby("camera", sort=True)
    )


def residual_field(camera: FrameCamera, grid: pd.DataFrame, points: pd.DataFrame) -> ResidualField:
    """The field of one camera from its rows of residual_grid.parquet and its image points."""
    grid = grid.sort_values(["row", "column"])
    shape = (int(grid["row"].max()) + 1, int(grid["column"].max()) + 1)

    def cells(name: str) -> Floats:
        return grid[name].to_numpy(np.float64).reshape(shape)

    x, y = cells("x_mm")[0], cells("y_mm")[:, 0]
    has_correction = bool(grid["correction_x_um"].notna().any())
    return ResidualField(
        camera,
        x,
        y,
        _seams(x, cells("width_mm")[0], cells("tile_x")[0]),
        _seams(y, cells("height_mm")[:, 0], cells("tile_y")[:, 0]),
        Vectors(cells("mean_vx_um"), cells("mean_vy_um")),
        Vectors(cells("correction_x_um"), cells("correction_y_um")) if has_correction else None,
        grid["significant"].to_numpy(bool).reshape(shape),
        len(points),
        _rms(points),
    )


def _seams(middle: Floats, width: Floats, tile: Floats) -> Floats:
    """Places between neighbouring sub-areas of different CCD images."""
    before = np.flatnonzero(np.diff(tile) != 0.0)
    return np.asarray(middle[before] + 0.5 * width[before])


def with_residuals(
    field: ResidualField, grid: pd.DataFrame, points: pd.DataFrame, confidence: float
) -> ResidualField:
    """The field of other residuals in the same sub-areas, such as those without a correction.

    Parameters
    ----------
    grid : the camera's rows of residual_grid.parquet.
    points : its image points (x_mm, y_mm, vx_um, vy_um, shows_x, shows_y).
    """
    shape = field.significant.shape
    found = residual_grid(
        residual_grid_cells(grid),
        points[["x_mm", "y_mm"]].to_numpy(np.float64) / _MM,
        points[["vx_um", "vy_um"]].to_numpy(np.float64),
        points[["shows_x", "shows_y"]].to_numpy(bool),
    )
    mean = Vectors(found.mean[:, 0].reshape(shape), found.mean[:, 1].reshape(shape))
    significant = found.significant(confidence).reshape(shape)
    return replace(field, mean=mean, correction=None, significant=significant, rms_um=_rms(points))


def _rms(points: pd.DataFrame) -> tuple[float, float]:
    """Root mean square of the residuals in x and y, µm; NaN without any."""
    v = points[["vx_um", "vy_um"]].to_numpy(np.float64)
    square = np.mean(v**2, axis=0) if len(v) else np.full(2, np.nan)
    return float(np.sqrt(square[0])), float(np.sqrt(square[1]))


def field_plot(field: ResidualField, vectors: Vectors, words: str) -> Markup:
    """Vectors over the format, with the borders of the CCD images and a scale arrow.

    Parameters
    ----------
    vectors : the means, or the correction, of the field.
    words : what is drawn, for who cannot see it.
    """
    plot = FormatPlot.within(field.camera.half_format, 70.0, 10.0, axes.WIDTH - 82.0, 640.0)
    parts = [*plot.marks(), plot.seams(field.seams_x_mm.tolist(), field.seams_y_mm.tolist())]
    bottom = plot.bottom + 52
    if field.longest_um > 0.0:
        per_um = arrow_length(field, plot) / field.longest_um
        parts += field_vectors(field, vectors, plot, per_um)
        length = round_length(1.5 * field.longest_um)
        parts.append(arrow_scale(plot.left, bottom + 6, length * per_um, f"{length:g} µm", "mean"))
        if vectors is field.mean:
            shift = plot.left + length * per_um + 100
            parts.append(arrow_scale(shift, bottom + 6, 24.0, "not significant", "mean weak"))
        bottom += 22
    return markup.svg(axes.WIDTH, bottom, f"{words} of camera {field.camera.name}", *parts)


def arrow_length(field: ResidualField, plot: FormatPlot) -> float:
    """Length of the longest arrow, drawing units: about a sub-area."""
    return min(max(0.95 * _shorter_side(field, plot), 14.0), 60.0)


def longer_arrow(field: ResidualField, plot: FormatPlot, factor: float) -> float:
    """`factor` times this length, but never beyond the margin around a plot among others."""
    return min(factor * arrow_length(field, plot), 0.5 * _shorter_side(field, plot) + MARGIN)


def _shorter_side(field: ResidualField, plot: FormatPlot) -> float:
    """Of a sub-area, drawing units."""
    width = (plot.x.end - plot.x.start) / len(field.x_mm)
    height = (plot.y.start - plot.y.end) / len(field.y_mm)
    return min(width, height)


def field_vectors(field: ResidualField, vectors: Vectors, plot: FormatPlot, per_um: float) -> list[Markup]:
    """One path each for the vectors that are significant and, of means, for the others."""
    x, y = np.meshgrid(field.x_mm, field.y_mm)
    is_weak = ~field.significant if vectors is field.mean else np.zeros_like(field.significant)
    paths = []
    for css, chosen in (("mean weak", vectors.drawn & is_weak), ("mean", vectors.drawn & ~is_weak)):
        at = np.column_stack([x[chosen], y[chosen]])
        v = np.nan_to_num(np.column_stack([vectors.x_um[chosen], vectors.y_um[chosen]]))
        paths.append(plot.vectors(at, v * per_um, css))
    return [path for path in paths if path]


def field_table(fields: Sequence[ResidualField], confidence: float) -> Table:
    """Figures of the residuals of each camera; `confidence` is that of the tests."""

    def px(field: ResidualField, axis: int) -> float:
        return field.rms_um[axis] / (field.camera.pixel_size * 1e6)

    shown = (
        text_of("camera", "camera", lambda field: field.camera.name),
        number_of("image_points", "image points"),
        number_of("rms_x_um", "RMS x", "µm", 2, of=lambda field: field.rms_um[0]),
        number_of("rms_y_um", "RMS y", "µm", 2, of=lambda field: field.rms_um[1]),
        number_of("rms_x_px", "RMS x", "px", 3, of=lambda field: px(field, 0)),
        number_of("rms_y_px", "RMS y", "px", 3, of=lambda field: px(field, 1)),
        number_of("cells", "sub-areas with a mean", of=lambda field: field.mean.drawn.sum()),
        number_of("significant", "of them significant", of=lambda field: field.significant.sum()),
        number_of(
            "by_chance", "expected by chance", of=lambda field: (1.0 - confidence) * field.mean.drawn.sum()
        ),
        number_of("largest_um", "largest mean", "µm", 2, of=lambda field: field.mean.largest_um),
    )
    caption = "Image residuals by camera"
    return table_of("image-residuals", caption, shown, fields, lambda field: str(field.camera.name))
