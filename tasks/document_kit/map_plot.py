"""A map: equal scales along east and north, coordinates in kilometres at its border."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches

_LEFT, _RIGHT, _TOP, _BOTTOM = 78.0, 12.0, 10.0, 44.0
_TALLEST = 760.0
# What the longest legend of symbols and arrows needs.
_LEGEND = 820.0
_KM = 1e-3


@dataclass(frozen=True)
class MapPlot:
    """Where map coordinates lie in the drawing.

    Attributes
    ----------
    x, y : scales of east and north, metres.
    """

    x: Scale
    y: Scale

    @classmethod
    def over(cls, x: Floats, y: Floats, margin: float = 0.03) -> MapPlot:
        """A map that shows all points (n,), (n,) with a margin, as wide as the page unless too tall."""
        west, east, south, north = (float(v) for v in (np.min(x), np.max(x), np.min(y), np.max(y)))
        border = margin * max(east - west, north - south, 1.0)
        west, east, south, north = west - border, east + border, south - border, north + border
        unit = min((axes.WIDTH - _LEFT - _RIGHT) / (east - west), _TALLEST / (north - south))
        width, height = unit * (east - west), unit * (north - south)
        # A narrow block is in the middle.
        left = _LEFT + 0.5 * (axes.WIDTH - _LEFT - _RIGHT - width)
        return cls(Scale(west, east, left, left + width), Scale(south, north, _TOP + height, _TOP))

    @property
    def unit(self) -> float:
        """Drawing units of a metre."""
        return self.x.unit

    @property
    def bottom(self) -> float:
        """Height below the axis and its label."""
        return self.y.start + _BOTTOM

    @property
    def legend_x(self) -> float:
        """Where legends begin: below the map; of a narrow one further left, so that they are not cut off."""
        return min(self.x.start, axes.WIDTH - _RIGHT - _LEGEND)

    def legend(self, heading: str, entries: Sequence[Swatch], y: float | None = None) -> tuple[Markup, float]:
        """A legend from `y` on, by default below the axes, and where it ends."""
        below = self.bottom + 6 if y is None else y
        return swatches(self.legend_x, below, heading, entries, axes.WIDTH - self.legend_x - 10)

    def axes(self) -> Markup:
        """Border, ticks and labels of both axes."""
        along, up = self.x, self.y
        across = Scale(along.lower * _KM, along.upper * _KM, along.start, along.end)
        upwards = Scale(up.lower * _KM, up.upper * _KM, up.start, up.end)
        return Markup("").join(
            [
                axes.horizontal_axis(across, up.end, up.start, "east [km]", about=_ticks(across)),
                axes.vertical_axis(upwards, along.start, along.end, "north [km]", about=_ticks(upwards)),
                axes.frame(along.start, up.end, along.end, up.start),
            ]
        )


def _ticks(scale: Scale) -> int:
    """As many ticks as have room for their texts."""
    return max(2, int(abs(scale.end - scale.start) / 110.0))
