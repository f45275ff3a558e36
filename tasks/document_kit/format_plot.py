"""Drawings over the format of an image: its frame in true proportion, axes, CCD borders, vectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup
from tasks.document_kit.axes import Scale

_MM = 1e3


@dataclass(frozen=True)
class FormatPlot:
    """An image format in a drawing.

    Attributes
    ----------
    x, y : from millimetres in image axes, origin at the middle of the format, to places.
    """

    x: Scale
    y: Scale

    @classmethod
    def within(
        cls, half_format: tuple[float, float], left: float, top: float, width: float, height: float
    ) -> FormatPlot:
        """A plot as large as fits into a box, at its left edge; `half_format` in metres."""
        half_x, half_y = (half * _MM for half in half_format)
        unit = min(width / (2 * half_x), height / (2 * half_y))
        return cls(
            Scale(-half_x, half_x, left, left + 2 * half_x * unit),
            Scale(-half_y, half_y, top + 2 * half_y * unit, top),
        )

    @property
    def left(self) -> float:
        """Left edge, drawing units."""
        return self.x.start

    @property
    def bottom(self) -> float:
        """Lower edge, drawing units."""
        return self.y.start

    def marks(self) -> tuple[Markup, ...]:
        """Both axes with labels, and the border of the format."""
        return (
            axes.horizontal_axis(self.x, self.y.end, self.y.start, "x of the image [mm]"),
            axes.vertical_axis(self.y, self.x.start, self.x.end, "y of the image [mm]"),
            self.frame(),
        )

    def frame(self) -> Markup:
        """The border of the format."""
        return axes.frame(self.x.start, self.y.end, self.x.end, self.y.start)

    def seams(self, across_x: Sequence[float], across_y: Sequence[float]) -> Markup:
        """Borders of the CCD images: lines x = constant and lines y = constant, mm in image axes."""
        upright = [(self.x.at(at), self.y.start, self.x.at(at), self.y.end) for at in across_x]
        level = [(self.x.start, self.y.at(at), self.x.end, self.y.at(at)) for at in across_y]
        return markup.group("seams", [markup.line(*ends) for ends in (*upright, *level)])

    def vectors(self, at_mm: Floats, vectors: Floats, css_class: str) -> Markup:
        """Arrows (n, 2), drawing units with y upwards, from points (n, 2) in mm; empty without any."""
        data = "".join(
            markup.arrow(self.x.at(x), self.y.at(y), dx, -dy, 4.0)
            for (x, y), (dx, dy) in zip(at_mm.tolist(), vectors.tolist(), strict=True)
        )
        return markup.element("path", css=css_class, d=data) if data else Markup("")
