"""The map of differences at directly georeferenced points."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from tasks.block.strip_names import strip_names
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.difference_arrows import ArrowScale, arrows, symbol
from tasks.document_kit.map_plot import MapPlot
from tasks.documents.georeferencing.material import CheckMaterial
from tasks.georeferencing.point_differences import INDEPENDENT

# Above this many images their places would hide the points.
_MOST_IMAGES = 3000


def difference_map(material: CheckMaterial) -> Markup:
    """Arrows of the differences over the strips; needs at least one point."""
    points, exposures = material.points, material.exposures
    flown = exposures[["x_m", "y_m"]].to_numpy(np.float64)
    everything = np.vstack([flown, points[["x_m", "y_m"]].to_numpy(np.float64)])
    plot = MapPlot.over(everything[:, 0], everything[:, 1])
    parts = [plot.axes(), _strips(material, plot)]
    scale = ArrowScale.of(points)
    for row in points.to_dict("records"):
        place = plot.x.at(float(str(row["x_m"]))), plot.y.at(float(str(row["y_m"])))
        if scale is not None:
            parts += arrows(row, place, scale)
        shown = [
            f"d{axis} {float(str(row[f'd{axis}_m'])):+.3f} m"
            for axis in "xyz"
            if np.isfinite(float(str(row[f"d{axis}_m"])))
        ]
        kind = "check point" if row["status"] == INDEPENDENT else "calibration control"
        words = f"{kind} {row['point']}: {', '.join(shown)}"
        parts.append(symbol(place, row["status"] == INDEPENDENT, took_part=True, words=words))
    y = plot.bottom + 6
    x = plot.x.start
    for is_check, words, width in (
        (True, "independent check point", 190.0),
        (False, "calibration control", 200.0),
    ):
        parts += [symbol((x + 7, y + 10), is_check, took_part=True, words="")]
        parts.append(markup.text(x + 20, y + 14, words, "start"))
        x += width
    if scale is not None:
        parts.append(scale.legend(x + 10, y + 10))
    return markup.svg(axes.WIDTH, y + 34, "Map of the differences", *parts)


def _strips(material: CheckMaterial, plot: MapPlot) -> Markup:
    """A line through the exposures of every strip."""
    exposures = material.exposures
    if len(exposures) > _MOST_IMAGES:
        return Markup("")
    lines = []
    named = exposures[exposures["strip"].notna()]
    names = strip_names(named["flight"].fillna(""), named["strip"])
    for name, strip in named.groupby(names, sort=True):
        ordered = strip.sort_values(["time_s", "image"], kind="stable")
        x, y = (scale.of(ordered[c].to_numpy(np.float64)) for scale, c in ((plot.x, "x_m"), (plot.y, "y_m")))
        path = markup.path_of(x, y)
        lines.append(
            markup.element(
                "path",
                {"class": "track", "d": path, "stroke": palette.FAINT},
                markup.title(f"strip {name}"),
            )
        )
    return markup.group("strips", lines)
