"""Differences at surveyed points on a map: arrows in plan, arrows for the height, symbols."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from tasks.document_kit import markup
from tasks.document_kit.axes import round_length
from tasks.document_kit.legend import arrow_scale

_LONGEST_ARROW = 46.0


@dataclass(frozen=True)
class ArrowScale:
    """Drawing units of a metre of difference, and the round length of the scale arrow."""

    unit: float
    length_m: float

    @classmethod
    def of(cls, surveyed: pd.DataFrame) -> ArrowScale | None:
        """The scale at which the largest of dx_m, dy_m, dz_m is long; None without any difference."""
        plan = np.hypot(surveyed["dx_m"].fillna(0.0), surveyed["dy_m"].fillna(0.0))
        largest = float(max(plan.max(), surveyed["dz_m"].abs().fillna(0.0).max()))
        if not largest > 0.0:
            return None
        return cls(_LONGEST_ARROW / largest, round_length(largest))

    def legend(self, x: float, y: float) -> Markup:
        """Arrows of round length, one along and one up, with their meaning."""
        length, words = self.length_m * self.unit, length_words(self.length_m)
        in_plan = arrow_scale(x, y, length, f"{words} in plan", "plan")
        in_height = arrow_scale(
            x + 20 + length + 80,
            y + 8,
            0.35 * length,
            "height, up = computed higher",
            "height",
            upright=True,
        )
        return Markup("").join([in_plan, in_height])


def length_words(metres: float) -> str:
    """A round length in words."""
    return f"{metres * 100:g} cm" if metres < 1.0 else f"{metres:g} m"


def arrows(row: Mapping[Hashable, Any], place: tuple[float, float], scale: ArrowScale) -> list[Markup]:
    """Arrow of the plan difference, and one straight up or down for the height."""
    dx, dy, dz = (float(np.nan_to_num(float(row[f"{name}_m"]))) * scale.unit for name in ("dx", "dy", "dz"))
    drawn = []
    if dx or dy:
        drawn.append(markup.element("path", css="plan", d=markup.arrow(*place, dx, -dy)))
    if dz:
        drawn.append(markup.element("path", css="height", d=markup.arrow(*place, 0.0, -dz)))
    return drawn


def symbol(place: tuple[float, float], is_check: bool, took_part: bool, words: str) -> Markup:
    """A triangle for control, a circle for a check point; hollow if it is not used."""
    x, y = place
    named = [markup.title(words)] if words else []
    css = "point" if took_part else "point hollow"
    if is_check:
        return markup.circle(x, y, 5.0, *named, css=css)
    data = markup.path_of(np.array([x, x + 6, x - 6]), np.array([y - 7, y + 4.5, y + 4.5]), closed=True)
    return markup.element("path", *named, css=css, d=data)
