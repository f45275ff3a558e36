"""Charts: curves and bars in a frame with two axes, and a legend below."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches

#: Left border of a chart, with room for the words of its vertical axis; its right border; its top.
LEFT, RIGHT, TOP = 78.0, axes.WIDTH - 12.0, 10.0
#: Colour of bars.
BAR = "#b5d6e5"


def chart(
    words: str,
    x: Scale,
    y: Scale,
    labels: tuple[str, str],
    drawn: Iterable[Markup],
    entries: Sequence[Swatch],
    heading: str = "",
    about: int = 8,
) -> Markup:
    """A chart.

    Parameters
    ----------
    words : what it shows, for those who cannot see it.
    labels : of the horizontal and the vertical axis.
    drawn : its curves and bars.
    entries, heading : of its legend.
    about : number of ticks along.
    """
    top, bottom = sorted((y.start, y.end))
    legend, end = swatches(x.start, bottom + 48, heading, entries, RIGHT - x.start)
    return markup.svg(
        axes.WIDTH,
        end + 4,
        words,
        axes.horizontal_axis(x, top, bottom, labels[0], about=about),
        axes.vertical_axis(y, x.start, x.end, labels[1]),
        *drawn,
        axes.frame(x.start, top, x.end, bottom),
        legend,
    )


def bars(x: Scale, y: Scale, edges: Floats, heights: Floats, *content: Markup) -> Markup:
    """The bars of a histogram, (n,), between edges (n + 1,) at equal distances."""
    bottom, width = markup.number(y.start), markup.number((edges[1] - edges[0]) * x.unit - 1)
    data = "".join(
        f"M{markup.number(x.at(edge))},{bottom}V{markup.number(y.at(height))}h{width}V{bottom}z"
        for edge, height in zip(edges[:-1].tolist(), heights.tolist(), strict=True)
        if height > 0
    )
    return markup.element("path", *content, fill=BAR, d=data)
