"""What ``aerocal doctor`` read, and how well the given orientations fit, as tables on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from tasks.files.json_text import JSON

# Control points shown; a block may have hundreds.
_MOST = 5
#: Figures of the imports in their order on the screen: stage, name of the figure, words.
_COUNTS = (
    ("exposures and cameras", "exposures", "exposures"),
    ("image points", "exposures_without_image_points", "  without image points"),
    ("control", "control", "control points"),
    ("control", "check", "check points"),
    ("image points", "image_points_read", "image points read"),
    ("image points", "outside_format", "  outside the image format"),
    ("image points", "image_points", "  used"),
    ("image points", "object_points", "object points"),
    ("image points", "single_ray_points", "  ignored, measured in one image only"),
)
_RESIDUALS = (
    ("tie_rms_px", "tie points, intersected"),
    ("control_reprojection_rms_px", "control points, as surveyed"),
)


def examination_tables(figures: Mapping[str, Mapping[str, JSON]]) -> list[RenderableType]:
    """Tables of the figures (subject → figures) that the stages of an examination found."""
    fit = cast(Mapping[str, JSON], figures.get("approximate values", {}).get("given_orientations", {}))
    control = cast(Sequence[Mapping[str, JSON]], fit.get("control", ()))
    tables = {
        "The delivery": _read(figures),
        "Image residuals with the given orientations": _residuals(fit),
        "Control points: intersected with the given orientations, less surveyed": _differences(control),
    }
    return [
        part
        for title, table in tables.items()
        if table.row_count
        for part in (Text(f"\n{title}", style="bold"), table)
    ]


def _read(figures: Mapping[str, Mapping[str, JSON]]) -> Table:
    table = _columns()
    table.show_header = False
    table.add_column()
    table.add_column(justify="right")
    for subject, name, words in _COUNTS:
        count = cast(Mapping[str, int], figures.get(subject, {}).get("counts", {})).get(name)
        if count is not None:
            table.add_row(words, f"{count:,}")
    return table


def _residuals(fit: Mapping[str, JSON]) -> Table:
    table = _columns("RMS, px", "column", "row")
    for name, words in _RESIDUALS:
        rms = cast(Sequence[float] | None, fit.get(name))
        if rms is not None:
            table.add_row(words, *(f"{value:.3f}" for value in rms))
    return table


def _differences(control: Sequence[Mapping[str, JSON]]) -> Table:
    """The control points with the largest differences, largest first."""
    by_size = sorted(control, key=lambda point: -max(map(abs, _difference(point))))
    table = _columns("point", "rays", "east, m", "north, m", "height, m")
    for point in by_size[:_MOST]:
        table.add_row(
            str(point["point"]), str(point["rays"]), *(f"{value:+.3f}" for value in _difference(point))
        )
    if len(control) > _MOST:
        table.caption = f"and {len(control) - _MOST:,} more, with smaller differences (--json has all)"
        table.caption_justify = "left"
    return table


def _difference(point: Mapping[str, JSON]) -> tuple[float, float, float]:
    """(east, north, height), metres."""
    dx, dy, dz = (cast(float, point[name]) for name in ("dx_m", "dy_m", "dz_m"))
    return dx, dy, dz


def _columns(*names: str) -> Table:
    """A table whose first column is text and whose others are numbers."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for number, name in enumerate(names):
        table.add_column(name, justify="right" if number else "left")
    return table
