"""Virtual images composed of several heads: errors with the given and σ with the calibrated attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup
from tasks.document_kit.axes import round_length
from tasks.document_kit.format_plot import FormatPlot
from tasks.document_kit.legend import arrow_scale
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.material import Material


@dataclass(frozen=True, eq=False)
class VirtualImage:
    """The virtual image of one platform on its grid (virtual_image.parquet).

    Attributes
    ----------
    name : of the platform.
    half_format : half the sides of the image, metres.
    points : its rows of the table.
    """

    name: str
    half_format: tuple[float, float]
    points: pd.DataFrame

    @property
    def filled(self) -> pd.DataFrame:
        """The points that a head fills."""
        return self.points[self.points["head"].notna()]

    @property
    def longest_um(self) -> float:
        """Length of the longest error with the given attitudes, µm."""
        return float(np.hypot(self.filled["dx_um"], self.filled["dy_um"]).max())


def virtual_images(material: Material) -> tuple[VirtualImage, ...]:
    """Every platform of which the heads were calibrated, by name."""
    table = material.virtual_image
    if table.empty:
        return ()
    return tuple(
        VirtualImage(str(name), material.cameras[str(name)].half_format, own)
        for name, own in table.groupby("platform", sort=True)
    )


def virtual_image_table(images: tuple[VirtualImage, ...]) -> Table:
    """Root mean squares and largest values over the part of the virtual image that each head fills."""
    columns = (
        text_column("head", "head"),
        Column("part", "part of the image", "%"),
        Column("rms_x_um", "RMS x", "µm"),
        Column("rms_y_um", "RMS y", "µm"),
        Column("largest_um", "largest", "µm"),
        Column("sigma_x_um", "largest σ x", "µm"),
        Column("sigma_y_um", "largest σ y", "µm"),
        Column("correlation", "correlation x, y"),
        Column("sigma_step_x_um", "step: largest σ x", "µm"),
        Column("sigma_step_y_um", "step: largest σ y", "µm"),
        Column("seam_x_um", "10 % closer: x", "µm"),
        Column("seam_y_um", "10 % closer: y", "µm"),
    )
    rows = []
    for image in images:
        for head, own in image.filled.groupby("head", sort=True):
            error = own[["dx_um", "dy_um"]].to_numpy(np.float64)
            values = (
                100.0 * len(own) / len(image.points),
                *np.sqrt(np.mean(error**2, axis=0)),
                np.hypot(*error.T).max(),
                *own[["sigma_x_um", "sigma_y_um"]].max(),
                own["correlation"].iloc[int(own["correlation"].abs().argmax())],
                *own[["sigma_step_x_um", "sigma_step_y_um"]].max(),
                *own[["seam_x_um", "seam_y_um"]].mean(),
            )
            cells = (*numbers(values[:1], 1), *numbers(values[1:], 2))
            rows.append(Row(f"{head}@{image.name}", (str(head), *cells)))
    note = (
        "RMS and largest: errors of an image composed with the given attitudes. σ: of one composed with the "
        "calibrated attitudes, and its strongest correlation. Step: between two heads that cover the "
        "same point, from their joint covariance. 10 % closer: mean displacement of ground at 0.9 times the "
        "distance for which the image is composed. All points are in virtual_image.parquet."
    )
    return Table("virtual-image", "Virtual image, by head", columns, tuple(rows), note)


def virtual_image_plot(image: VirtualImage) -> Markup:
    """Errors of the given attitudes over the virtual image, with the borders of the heads' parts."""
    plot = FormatPlot.within(image.half_format, 70.0, 10.0, axes.WIDTH - 82.0, 640.0)
    there = image.filled
    x, y = np.unique(image.points["x_mm"]), np.unique(image.points["y_mm"])
    parts = [*plot.marks(), _borders(image, plot, x, y)]
    bottom = plot.bottom + 52.0
    longest = image.longest_um
    if longest > 0.0:
        per_um = 1.6 * float(np.diff(x).min()) * plot.x.unit / longest
        at = there[["x_mm", "y_mm"]].to_numpy(np.float64)
        error = there[["dx_um", "dy_um"]].to_numpy(np.float64)
        parts.append(plot.vectors(at, error * per_um, "mean"))
        length = round_length(1.5 * longest)
        parts.append(arrow_scale(plot.left, bottom + 6, length * per_um, f"{length:g} µm", "mean"))
        border = plot.left + length * per_um + 100.0
        parts.append(markup.group("seams", [markup.line(border, bottom + 6, border + 26.0, bottom + 6)]))
        words = markup.text(border + 34.0, bottom + 10, "border between heads", "start")
        parts.append(markup.group("legend", [words]))
        bottom += 22.0
    parts += _names(image, plot)
    return markup.svg(axes.WIDTH, bottom, f"Errors in the virtual image of {image.name}", *parts)


def _borders(image: VirtualImage, plot: FormatPlot, x: Floats, y: Floats) -> Markup:
    """Lines between neighbouring points of the grid that different heads fill."""
    grid = image.points.pivot(index="x_mm", columns="y_mm", values="head").fillna("").to_numpy(dtype=str)
    half = 0.5 * np.diff(x).min(), 0.5 * np.diff(y).min()
    lines = []
    for i, j in np.argwhere(grid[1:] != grid[:-1]):
        at, low, high = x[i] + half[0], y[j] - half[1], y[j] + half[1]
        lines.append(markup.line(plot.x.at(at), plot.y.at(low), plot.x.at(at), plot.y.at(high)))
    for i, j in np.argwhere(grid[:, 1:] != grid[:, :-1]):
        at, low, high = y[j] + half[1], x[i] - half[0], x[i] + half[0]
        lines.append(markup.line(plot.x.at(low), plot.y.at(at), plot.x.at(high), plot.y.at(at)))
    return markup.group("seams", lines)


def _names(image: VirtualImage, plot: FormatPlot) -> list[Markup]:
    """The name of each head in the middle of its part."""
    written = []
    for head, own in image.filled.groupby("head", sort=True):
        x, y = plot.x.at(own["x_mm"].mean()), plot.y.at(own["y_mm"].mean())
        # A white edge keeps it legible among the arrows.
        edge = {"stroke": "white", "stroke_width": "5", "paint_order": "stroke"}
        written.append(markup.text(x, y, str(head), css_class="label", **edge))
    return written
