"""Legends: colour classes, symbols and arrows of round length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from tasks.document_kit import markup

ROW = 18.0
_GLYPH = 7.2


@dataclass(frozen=True)
class Swatch:
    """One entry: a coloured square, or the ring of a map, and what it stands for."""

    colour: str
    words: str
    is_ring: bool = False


def swatches(
    x: float, y: float, heading: str, entries: Sequence[Swatch], width: float
) -> tuple[Markup, float]:
    """Entries in rows no wider than `width`, after a heading.

    Returns
    -------
    drawing : the legend, its first row at height `y`.
    bottom : the height under its last row.
    """
    parts = [markup.text(x, y + 11, heading, "start", "label")]
    at = x + 14 + _GLYPH * len(heading)
    for entry in entries:
        needed = 26 + _GLYPH * len(entry.words)
        if at + needed > x + width and at > x:
            at, y = x, y + ROW
        if entry.is_ring:
            parts.append(markup.circle(at + 6.5, y + 7, 6.0, css="ring"))
        else:
            parts.append(markup.rectangle(at, y + 1, 13, 12, fill=entry.colour, css="swatch"))
        parts.append(markup.text(at + 18, y + 11, entry.words, "start"))
        at += needed
    return markup.group("legend", parts), y + ROW


def arrow_scale(
    x: float, y: float, length: float, words: str, css_class: str, *, upright: bool = False
) -> Markup:
    """An arrow of known length with its meaning."""
    dx, dy = (0.0, -length) if upright else (length, 0.0)
    drawn = markup.element("path", css=css_class, d=markup.arrow(x, y, dx, dy))
    return markup.group(
        "legend", [drawn, markup.text(x + abs(dx) + 8, y - 4 if upright else y + 4, words, "start")]
    )
