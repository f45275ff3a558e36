"""Colours that remain distinct for colour-blind readers and on a grey printer.

Sequences run from light to dark, so that their order survives without hue. Categories are drawn from the
eight colours proposed by Okabe and Ito (2008).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

CATEGORIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#8C6D00", "#6A3D9A", "#444444")
INK = "#1f2933"
ACCENT = "#D55E00"
FAINT = "#9aa5b1"

# Anchors of a single-hue sequence, and of one through white for signed numbers.
_SEQUENCE = ("#e6f0f5", "#b5d6e5", "#74b0d0", "#3a83b3", "#1c5688", "#0b2d52")
_SIGNED = ("#0b4f8a", "#6baed6", "#ffffff", "#f0a25a", "#a63e00")


def sequence(count: int, darkest: float = 1.0) -> tuple[str, ...]:
    """`count` colours from light to dark; with `darkest` below 1 symbols on top of them stay visible."""
    if count == 1:
        return (_SEQUENCE[2],)
    return tuple(_between(_SEQUENCE, position) for position in np.linspace(0.0, darkest, count))


def signed(value: float) -> str:
    """Colour of a number from −1 (blue) over 0 (white) to 1 (orange)."""
    return _between(_SIGNED, 0.5 + 0.5 * float(np.clip(value, -1.0, 1.0)))


def category(index: int) -> str:
    """Colour of a category; they repeat after the eighth."""
    return CATEGORIES[index % len(CATEGORIES)]


def _between(anchors: Sequence[str], position: float) -> str:
    """Colour at a position 0 … 1 along evenly spaced anchors."""
    rgb = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in anchors], dtype=np.float64)
    at = position * (len(anchors) - 1)
    mixed = [round(float(np.interp(at, np.arange(len(anchors)), rgb[:, channel]))) for channel in range(3)]
    return "#{:02x}{:02x}{:02x}".format(*mixed)
