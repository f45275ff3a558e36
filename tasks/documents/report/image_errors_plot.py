"""Systematic image errors as vectors, and mean residuals before and after self-calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from tasks.document_kit import axes, markup
from tasks.document_kit.axes import round_length
from tasks.document_kit.format_plot import FormatPlot
from tasks.document_kit.legend import arrow_scale
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.image_errors import ImageErrors, PartOfErrors, additional_of, correction_um
from tasks.documents.report.material import Material
from tasks.documents.report.residual_field import (
    MARGIN,
    ResidualField,
    field_vectors,
    longer_arrow,
    residual_fields,
    with_residuals,
)

_PANELS = 3
_GAP = 30.0
_UM = 1e6


def errors_plot(errors: ImageErrors) -> Markup:
    """The vectors of all parameters together, CCD borders, and a scale arrow."""
    plot = FormatPlot.within(errors.camera.half_format, 70.0, 24.0, axes.WIDTH - 82.0, 640.0)
    part = errors.all
    bottom = plot.bottom + 52
    parts = [*plot.marks(), plot.seams(errors.seams_x_mm, errors.seams_y_mm)]
    if part.longest_um > 0.0:
        per_um = _per_um(errors, plot, part.longest_um)
        parts.append(_vectors(plot, part, per_um))
        parts += _scale(plot.left, bottom + 6, part.longest_um, per_um, errors)
        bottom += 22
    words = f"Systematic image errors of {errors.entity}"
    return markup.svg(axes.WIDTH, bottom, words, *parts)


def parts_plot(errors: ImageErrors) -> Markup | None:
    """A small drawing for each part of the selection, all with the same scale; None with one part only."""
    if not errors.parts:
        return None
    longest = max(part.longest_um for part in errors.parts)
    width = (axes.WIDTH - (_PANELS - 1) * _GAP) / _PANELS
    drawn, top, per_um = [], 0.0, 0.0
    for first in range(0, len(errors.parts), _PANELS):
        lower = top
        for index, part in enumerate(errors.parts[first : first + _PANELS]):
            left = index * (width + _GAP)
            plot = FormatPlot.within(errors.camera.half_format, left, top + 32.0, width, 420.0)
            per_um = _per_um(errors, plot, longest) if longest > 0.0 else 0.0
            heading = f"{part.title}: RMS {part.rms_um:.2f} µm, largest {part.largest_um:.2f} µm"
            drawn += [
                markup.text(plot.left, top + 15, heading, "start", "label"),
                plot.frame(),
                plot.seams(errors.seams_x_mm, errors.seams_y_mm),
                _vectors(plot, part, per_um),
            ]
            lower = max(lower, plot.bottom)
        top = lower + 24.0
    if longest > 0.0:
        drawn += _scale(4.0, top + 10, longest, per_um, errors)
        top += 26.0
    words = f"Systematic image errors of {errors.entity} by group of parameters"
    return markup.svg(axes.WIDTH, top, words, *drawn)


def _per_um(errors: ImageErrors, plot: FormatPlot, longest_um: float) -> float:
    """Drawing units of a micrometre: the longest vector reaches just over the next point of the grid."""
    return 1.15 * errors.spacing_mm * plot.x.unit / longest_um


def _vectors(plot: FormatPlot, part: PartOfErrors, per_um: float) -> Markup:
    return plot.vectors(part.at_mm, part.error_um * per_um, "mean")


def _scale(left: float, y: float, longest_um: float, per_um: float, errors: ImageErrors) -> list[Markup]:
    """An arrow of round length in µm and px, and the sign of CCD borders."""
    length = round_length(1.5 * longest_um)
    pixel = length / (errors.camera.pixel_size * _UM)
    drawn = [arrow_scale(left, y, length * per_um, f"{length:g} µm = {pixel:.2g} px", "mean")]
    if errors.seams_x_mm or errors.seams_y_mm:
        at = left + length * per_um + 150.0
        drawn.append(markup.group("seams", [markup.line(at, y, at + 26.0, y)]))
        drawn.append(
            markup.group("legend", [markup.text(at + 34.0, y + 4, "seam between CCD images", "start")])
        )
    return drawn


@dataclass(frozen=True, eq=False)
class BeforeAndAfter:
    """Mean residuals of a camera without and with the correction by its additional parameters.

    Attributes
    ----------
    before : of v + Δ: what would remain without the correction if nothing else moved.
    after : of v.
    """

    before: ResidualField
    after: ResidualField


def before_and_after(material: Material) -> tuple[BeforeAndAfter, ...]:
    """Of every camera with additional parameters and image points that were used; by name."""
    if material.self_calibration.empty:
        return ()
    points = material.image_residuals
    points = points[points["used"]].reset_index(drop=True)
    without = points.copy()
    without[["vx_um", "vy_um"]] += correction_um(material, points)
    cameras = set(additional_of(material)["camera"])
    return tuple(
        BeforeAndAfter(_without(material, after, without), after)
        for after in residual_fields(material)
        if after.camera.name in cameras
    )


def _without(material: Material, after: ResidualField, points: pd.DataFrame) -> ResidualField:
    """The field of a camera from the residuals v + Δ of the image points of all cameras."""
    grid = material.residual_grid
    name, confidence = after.camera.name, material.project.adjustment.confidence
    return with_residuals(after, grid[grid["camera"] == name], points[points["camera"] == name], confidence)


def comparison_plot(pair: BeforeAndAfter) -> Markup | None:
    """Both fields side by side in one scale; None where no sub-area has enough points."""
    longest = max(np.nan_to_num(field.mean.largest_um) for field in (pair.before, pair.after))
    if not longest > 0.0:
        return None
    width = (axes.WIDTH - 3.0 * MARGIN) / 2.0
    drawn: list[Markup] = []
    bottom, per_um = 0.0, 0.0
    headings = ("without the correction (v + Δ)", "with it (v)")
    for index, (field, words) in enumerate(zip((pair.before, pair.after), headings, strict=True)):
        left = MARGIN + index * (width + MARGIN)
        plot = FormatPlot.within(field.camera.half_format, left, 20.0 + MARGIN, width, 560.0)
        heading = f"{words}: RMS of the means {mean_rms_um(field):.2f} µm"
        per_um = longer_arrow(field, plot, 1.4) / longest
        drawn += [
            markup.text(plot.left, 15, heading, "start", "label"),
            plot.frame(),
            *field_vectors(field, field.mean, plot, per_um),
        ]
        bottom = plot.bottom + MARGIN
    length = round_length(1.5 * longest)
    drawn.append(arrow_scale(4.0, bottom, length * per_um, f"{length:g} µm", "mean"))
    drawn.append(arrow_scale(length * per_um + 110.0, bottom, 24.0, "not significant", "mean weak"))
    words = f"Mean residuals of camera {pair.after.camera.name} without and with self-calibration"
    return markup.svg(axes.WIDTH, bottom + 12.0, words, *drawn)


def mean_rms_um(field: ResidualField) -> float:
    """Root mean square length of the mean vectors that are drawn, µm; NaN without any."""
    squared = (np.nan_to_num(field.mean.x_um) ** 2 + np.nan_to_num(field.mean.y_um) ** 2)[field.mean.drawn]
    return float(np.sqrt(squared.mean())) if len(squared) else float("nan")


def comparison_table(pairs: Sequence[BeforeAndAfter]) -> Table:
    """Figures of the residuals without and with the correction."""
    columns = (
        text_column("camera", "camera"),
        text_column("correction", "correction"),
        Column("rms_x_um", "RMS x", "µm"),
        Column("rms_y_um", "RMS y", "µm"),
        Column("mean_rms_um", "RMS of the means", "µm"),
        Column("largest_um", "largest mean", "µm"),
        Column("cells", "sub-areas drawn"),
        Column("significant", "of them significant"),
    )
    rows = []
    for pair in pairs:
        for key, words, field in (("before", "without", pair.before), ("after", "with", pair.after)):
            name = field.camera.name
            cells = (
                *numbers((*field.rms_um, mean_rms_um(field), field.mean.largest_um), 2),
                *numbers((float(field.mean.drawn.sum()), float(field.significant.sum())), 0),
            )
            rows.append(Row(f"{key}@{name}", (name, words, *cells)))
    caption = "Image residuals without and with the correction"
    return Table("self-calibration-residuals", caption, columns, tuple(rows))
