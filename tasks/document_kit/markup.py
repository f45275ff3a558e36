"""Elements of SVG as text: escaped, with coordinates rounded to what can be seen.

Names of images and points come from files and may hold anything, so every text and every attribute
passes through the escaping of markupsafe; only what is already :class:`Markup` is taken as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from markupsafe import Markup, escape

from adjust.arrays import Floats

Attribute: TypeAlias = str | float | int
_CLASS = {"css": "class"}


def element(tag: str, *content: Markup | str, **attributes: Attribute) -> Markup:
    """One element with its attributes and content.

    Parameters
    ----------
    tag : name of the element.
    content : child elements (Markup) or text, which is escaped.
    attributes : by name, with _ for -, and `css` for the class, which may be empty; numbers are rounded to a
        tenth of a unit.
    """
    # Put together as plain text: a map has thousands of elements, and Markup.format takes each of them apart.
    named = "".join(
        f" {_CLASS.get(name) or name.replace('_', '-')}="
        f'"{escape(value) if isinstance(value, str) else number(value)}"'
        for name, value in attributes.items()
        if value != "" or name != "css"
    )
    inner = "".join(map(escape, content))
    return Markup(f"<{tag}{named}>{inner}</{tag}>" if inner else f"<{tag}{named}/>")


def number(value: float) -> str:
    """A coordinate of a drawing, to a tenth of a unit and without needless zeros."""
    text = f"{value:.1f}"
    text = text.removesuffix(".0")
    return "0" if text == "-0" else text


def group(css_class: str, children: Iterable[Markup]) -> Markup:
    """A group of elements that share a class."""
    return element("g", Markup("").join(children), css=css_class)


def title(text: str) -> Markup:
    """The text a browser shows while the pointer rests on the enclosing element."""
    return element("title", text)


def text(
    x: float, y: float, words: str, anchor: str = "middle", css_class: str = "", **looks: Attribute
) -> Markup:
    """A line of text; `anchor` is start, middle or end."""
    return element("text", words, x=x, y=y, **looks, text_anchor=anchor, css=css_class)


def turned_text(x: float, y: float, words: str, anchor: str = "middle", css_class: str = "") -> Markup:
    """A line of text that reads upwards."""
    turn = f"translate({number(x)} {number(y)}) rotate(-90)"
    return element("text", words, transform=turn, text_anchor=anchor, css=css_class)


def line(x1: float, y1: float, x2: float, y2: float, *content: Markup, **looks: Attribute) -> Markup:
    """A straight line; its looks come from the group around it, unless they are given."""
    return element("line", *content, x1=x1, y1=y1, x2=x2, y2=y2, **looks)


def rectangle(
    x: float, y: float, width: float, height: float, *content: Markup, **looks: Attribute
) -> Markup:
    """A rectangle, from its upper left corner."""
    return element("rect", *content, x=x, y=y, width=width, height=height, **looks)


def circle(x: float, y: float, r: float, *content: Markup, **looks: Attribute) -> Markup:
    """A circle around a point."""
    return element("circle", *content, cx=x, cy=y, r=r, **looks)


def curve(x: Floats, y: Floats, colour: str, **looks: Attribute) -> Markup:
    """A line of a plot through the points (n,), (n,)."""
    return element("path", css="curve", stroke=colour, d=path_of(x, y), **looks)


def path_of(x: Floats, y: Floats, *, closed: bool = False) -> str:
    """Path data through the points (n,), (n,)."""
    points = " ".join(f"{number(a)},{number(b)}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    return f"M{points}{'Z' if closed else ''}"


def arrow(x: float, y: float, dx: float, dy: float, head: float = 5.0) -> str:
    """Path data of an arrow from (x, y) by (dx, dy), in drawing units with y downwards."""
    length = float(np.hypot(dx, dy))
    if length < 0.05:
        return f"M{number(x)},{number(y)}h0.1"
    size = min(head, 0.5 * length) / length
    back_x, back_y = -size * dx, -size * dy
    tip_x, tip_y = x + dx, y + dy
    left = (tip_x + back_x - 0.4 * back_y, tip_y + back_y + 0.4 * back_x)
    right = (tip_x + back_x + 0.4 * back_y, tip_y + back_y - 0.4 * back_x)
    return (
        f"M{number(x)},{number(y)}L{number(tip_x)},{number(tip_y)}"
        f"M{number(left[0])},{number(left[1])}L{number(tip_x)},{number(tip_y)}"
        f"L{number(right[0])},{number(right[1])}"
    )


def svg(width: float, height: float, description: str, *children: Markup) -> Markup:
    """A drawing that fills the width it is given; `description` is what a screen reader says."""
    return element(
        "svg",
        *children,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {number(width)} {number(height)}",
        role="img",
        aria_label=description,
    )
