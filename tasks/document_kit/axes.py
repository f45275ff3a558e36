"""Scales and axes of the plots: round ticks, units in the labels, and scale bars of round length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import markup

#: Width of a drawing; its height follows from what it shows.
WIDTH = 960.0


@dataclass(frozen=True)
class Scale:
    """A linear scale from values to positions in the drawing.

    Attributes
    ----------
    lower, upper : values at the two ends.
    start, end : their places, drawing units.
    """

    lower: float
    upper: float
    start: float
    end: float

    @property
    def unit(self) -> float:
        """Drawing units of one unit of the value."""
        return (self.end - self.start) / (self.upper - self.lower)

    def of(self, values: Floats) -> Floats:
        """Places (n,) of values (n,)."""
        return np.asarray(self.start + (np.asarray(values, dtype=np.float64) - self.lower) * self.unit)

    def at(self, value: float) -> float:
        """Place of one value."""
        return float(self.start + (value - self.lower) * self.unit)

    def ticks(self, about: int = 6) -> tuple[float, ...]:
        """Round values within the scale, roughly `about` of them."""
        step = tick_step(self.upper - self.lower, about)
        first = int(np.ceil(self.lower / step - 1e-9))
        last = int(np.floor(self.upper / step + 1e-9))
        return tuple(index * step for index in range(first, last + 1))


def tick_step(extent: float, about: int) -> float:
    """The step 1, 2 or 5 · 10ᵏ that divides an extent into roughly `about` parts."""
    raw = max(extent, 1e-12) / max(about, 1)
    power = 10.0 ** np.floor(np.log10(raw))
    for factor in (1.0, 2.0, 5.0):
        if raw <= 1.0001 * factor * power:
            return float(factor * power)
    return float(10.0 * power)


def round_length(largest: float) -> float:
    """The largest of 1, 2, 5 · 10ᵏ that does not exceed `largest`."""
    if not largest > 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(largest))
    factor = next(f for f in (5.0, 2.0, 1.0, 0.5) if f * power <= largest * 1.0001)
    return float(factor * power)


def tick_texts(ticks: Sequence[float]) -> tuple[str, ...]:
    """Texts of ticks, all with as many decimals as their step needs."""
    step = min(np.diff(ticks), default=1.0)
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9))) if step > 0 else 0
    # Four digits are read at a glance; coordinates in kilometres have no more.
    comma = "," if any(abs(tick) >= 10_000 for tick in ticks) else ""
    return tuple(f"{tick + 0.0:{comma}.{decimals}f}".replace("-", "−") for tick in ticks)


def horizontal_axis(scale: Scale, top: float, bottom: float, label: str, *, about: int = 8) -> Markup:
    """Ticks, their texts, grid lines up to `top`, and the label under them."""
    ticks = scale.ticks(about)
    places = [scale.at(tick) for tick in ticks]
    lines = [markup.line(x, top, x, bottom + 4) for x in places]
    texts = [markup.text(x, bottom + 17, words) for x, words in zip(places, tick_texts(ticks), strict=True)]
    middle = 0.5 * (scale.start + scale.end)
    named = markup.text(middle, bottom + 36, label, css_class="label")
    return markup.group("axis", [*lines, *texts, named])


def vertical_axis(scale: Scale, left: float, right: float, label: str, *, about: int = 6) -> Markup:
    """Ticks, their texts, grid lines to `right`, and the label turned next to them."""
    ticks = scale.ticks(about)
    places = [scale.at(tick) for tick in ticks]
    lines = [markup.line(left - 4, y, right, y) for y in places]
    words = tick_texts(ticks)
    texts = [markup.text(left - 8, y + 4, word, "end") for y, word in zip(places, words, strict=True)]
    middle = 0.5 * (scale.start + scale.end)
    x = left - 14 - 7 * max((len(word) for word in words), default=1)
    return markup.group("axis", [*lines, *texts, markup.turned_text(x, middle, label, css_class="label")])


def frame(left: float, top: float, right: float, bottom: float) -> Markup:
    """The border of a plot."""
    return markup.element("rect", css="frame", x=left, y=top, width=right - left, height=bottom - top)
