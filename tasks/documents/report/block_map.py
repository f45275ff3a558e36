"""The map of the block: overlap, footprints, images by strip, control and check points with differences."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.difference_arrows import ArrowScale, arrows, length_words, symbol
from tasks.document_kit.footprints import footprints, overlap
from tasks.document_kit.legend import Swatch, arrow_scale
from tasks.document_kit.map_plot import MapPlot
from tasks.document_kit.raster import Classes, Raster, cells
from tasks.documents.report.causes import Cause
from tasks.documents.report.first_screen import ring_id
from tasks.documents.report.material import IMAGE_POINTS, Material

_GROUP = "gnss_positions"
#: Above this many images arrows would only be a grey area.
MOST_IMAGES = 600


def position_differences(material: Material, images: pd.DataFrame) -> pd.DataFrame:
    """image, x_m, y_m, dx_m, dy_m, dz_m of each image with a GNSS position, rejected or not."""
    table = material.residuals
    if table.empty or len(images) > MOST_IMAGES:
        return pd.DataFrame(columns=["image", "x_m", "y_m", "dx_m", "dy_m", "dz_m"], dtype=np.float64)
    own = table[(table["group"] == _GROUP) & table["component"].isin(list("xyz")) & table["image"].notna()]
    wide = own.pivot_table(index="image", columns="component", values="residual", aggfunc="first")
    wide = wide.reindex(columns=list("xyz")).set_axis(["dx_m", "dy_m", "dz_m"], axis=1)
    return images[["image", "x_m", "y_m"]].merge(wide, left_on="image", right_index=True)


def position_arrows(found: pd.DataFrame, scale: ArrowScale, plot: MapPlot, y: float) -> Markup:
    """The arrows of ``position_differences`` with their legend at the height y."""
    dx, dy = (np.nan_to_num(found[name].to_numpy(np.float64)) * scale.unit for name in ("dx_m", "dy_m"))
    places = zip(plot.x.of(found["x_m"].to_numpy()), plot.y.of(found["y_m"].to_numpy()), strict=True)
    data = "".join(
        markup.arrow(float(east), float(north), float(right), float(-up))
        for (east, north), right, up in zip(places, dx, dy, strict=True)
        if right or up
    )
    length = scale.length_m * scale.unit
    words = f"{length_words(scale.length_m)} in plan, adjusted − GNSS position"
    legend = arrow_scale(plot.legend_x, y + 10, length, words, "gnss")
    arrows = markup.element("path", css="gnss", d=data)
    return markup.group("positions", [arrows, legend])


_CELLS = 200
#: Above this many images the outlines of footprints would only be a grey area.
MOST_OUTLINES = 600
# Above this many images each strip is one element: single names would take several megabytes.
_MOST_NAMED = 3000
_MOST_STRIP_NAMES = 40
_SHOWN = ("image", "strip", "camera", "rejected")
# More rings than these hide the map: a flight or a height is named in words.
_MOST_RINGS = 80
_RING = "#d81b1b"
_SINGLE = "#f6c9a8"
# The overlap is the ground on which all symbols stand.
_DARKEST = 0.68


def block_map(material: Material, found: Sequence[Cause] = ()) -> Markup:
    """The map with its legends; needs at least one adjusted image.

    Parameters
    ----------
    found : what to look at: its images and points get a ring.
    """
    images = material.oriented
    images = images.assign(rejected=images["image"].isin(_rejected_images(material)))
    corners = footprints(images, material.cameras)
    known = corners[np.isfinite(corners).all(axis=(1, 2))].reshape(-1, 2)
    surveyed = _surveyed(material)
    everything = np.vstack(
        [known, images[["x_m", "y_m"]].to_numpy(np.float64), surveyed[["x_m", "y_m"]].to_numpy(np.float64)]
    )
    plot = MapPlot.over(everything[:, 0], everything[:, 1])
    covered, entries = _overlap(corners, known, plot)
    parts = [covered, plot.axes(), _outlines(images, corners, plot), _strips(images, plot)]
    legend, y = plot.legend("images that see the ground", entries)
    parts += [legend]
    of_positions = position_differences(material, images)
    scale = ArrowScale.of(pd.concat([surveyed, of_positions], ignore_index=True))
    if len(of_positions) and scale is not None:
        parts.append(position_arrows(of_positions, scale, plot, y))
        y += 22
    if len(surveyed):
        drawn, y = _points(surveyed, scale, plot, y)
        parts.append(drawn)
    parts.append(_strip_names(images, plot))
    rings = _rings(images, surveyed, found, plot)
    if rings:
        legend, y = plot.legend("", [Swatch(_RING, "cause named above", is_ring=True)], y)
        parts += [markup.group("rings", rings), legend]
    return markup.svg(axes.WIDTH, y + 8, "Map of the block", *parts)


def _rejected_images(material: Material) -> set[str]:
    """Images of which a position or an attitude was rejected."""
    table = material.residuals
    own = table[(table["status"] == "rejected") & (table["group"] != IMAGE_POINTS) & table["image"].notna()]
    return set(own["image"])


def _rings(
    images: pd.DataFrame, surveyed: pd.DataFrame, found: Sequence[Cause], plot: MapPlot
) -> list[Markup]:
    """A ring with a name around every image and point to look at; none for whole flights."""
    parts = []
    named: set[str] = set()
    for cause in found:
        own = images[images["image"].isin(cause.images)]
        points = surveyed[surveyed["point"].isin(cause.points)]
        if len(own) > _MOST_RINGS:
            continue
        for place in pd.concat([own, points])[["x_m", "y_m"]].to_numpy(np.float64):
            own_id = {} if cause.place in named else {"id": ring_id(found, cause)}
            named.add(cause.place)
            x, y, words = plot.x.at(place[0]), plot.y.at(place[1]), markup.title(f"look at {cause.place}")
            parts.append(markup.circle(x, y, 11.0, words, css="ring", **own_id))
    return parts


def _overlap(corners: Floats, known: Floats, plot: MapPlot) -> tuple[Markup, list[Swatch]]:
    """Cells coloured by the number of footprints over them, and the entries of the legend."""
    if len(known) == 0:
        return Markup(""), []
    raster = Raster.over(known[:, 0], known[:, 1], _CELLS)
    count = overlap(corners, raster)
    classes = overlap_classes(int(count.max()))
    colours = (
        [_SINGLE, *palette.sequence(len(classes.words) - 1, _DARKEST)]
        if len(classes.words) > 1
        else [_SINGLE]
    )
    found = np.where(count > 0, classes.of(count.astype(np.float64)), -1)
    titles = [f"seen by {words} images" for words in classes.words]
    titles[0] = "seen by one image only"
    entries = [Swatch(colour, words) for colour, words in zip(colours, classes.words, strict=True)]
    entries[0] = Swatch(_SINGLE, "1 (no intersection)")
    return cells(raster, plot, found, colours, titles), entries


def overlap_classes(most: int) -> Classes:
    """Classes of the number of images: each number by itself up to 8, then in widening steps."""
    starts = list(range(1, min(most, 8) + 1))
    if most > 8:
        starts = [n for n in (1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50) if n <= most]
    ends = [following - 1 for following in starts[1:]] + [None]
    words = [_range(first, last) for first, last in zip(starts, ends, strict=True)]
    if starts[-1] == most:
        words[-1] = str(most)
    return Classes(tuple(float(n) for n in starts[1:]), tuple(words))


def _range(first: int, last: int | None) -> str:
    if last is None:
        return f"{first} and more"
    return str(first) if last == first else f"{first}–{last}"


def _outlines(images: pd.DataFrame, corners: Floats, plot: MapPlot) -> Markup:
    """Footprints as thin outlines, the fainter the more there are."""
    if len(images) > MOST_OUTLINES:
        return Markup("")
    data = "".join(
        markup.path_of(plot.x.of(corner[:, 0]), plot.y.of(corner[:, 1]), closed=True)
        for corner in corners
        if np.isfinite(corner).all()
    )
    opacity = f"{np.clip(6.0 / np.sqrt(len(images)), 0.1, 0.5):.2f}"
    return markup.element("path", css="footprint", stroke_opacity=opacity, d=data)


def _strips(images: pd.DataFrame, plot: MapPlot) -> Markup:
    """Per strip a line through its images, and a triangle at each in the direction of flight."""
    parts = []
    # Thousands of triangles of full size would hide the map under them.
    size = float(np.clip(70.0 / np.sqrt(len(images)), 2.0, 6.0))
    for index, (name, strip) in enumerate(images.groupby("strip", sort=True)):
        colour = palette.category(index)
        x, y = plot.x.of(strip["x_m"].to_numpy()), plot.y.of(strip["y_m"].to_numpy())
        drawn = [markup.element("path", css="track", d=markup.path_of(x, y), stroke=colour)] if name else []
        triangles = _triangles(x, y, strip["heading_deg"].to_numpy(np.float64), size)
        if len(images) <= _MOST_NAMED:
            drawn += [
                markup.element("path", markup.title(title), **_look(triangle, colour, hollow=hollow))
                for triangle, title, hollow in zip(triangles, _titles(strip), strip["rejected"], strict=True)
            ]
        else:
            data = {"d": "".join(triangles), "fill": colour}
            drawn.append(markup.element("path", markup.title(f"strip {name}"), **data))
        parts.append(markup.group("strip", drawn))
    return markup.group("strips", parts)


def _strip_names(images: pd.DataFrame, plot: MapPlot) -> Markup:
    """The names of the strips, if there are not too many."""
    strips = [(str(name), own) for name, own in images.groupby("strip", sort=True) if name]
    shown = strips if images["strip"].nunique() <= _MOST_STRIP_NAMES else []
    names = [
        _strip_name(name, plot.x.of(own["x_m"].to_numpy()), plot.y.of(own["y_m"].to_numpy()))
        for name, own in shown
    ]
    return markup.group("strip-names", names)


def _look(triangle: str, colour: str, *, hollow: bool) -> dict[str, markup.Attribute]:
    """Attributes of the triangle of an image; hollow if its position or attitude was rejected."""
    if hollow:
        return {"css": "left-out", "d": triangle, "fill": "#fff", "style": f"stroke: {colour}"}
    return {"d": triangle, "fill": colour}


def _titles(strip: pd.DataFrame) -> list[str]:
    """What the pointer shows at each image."""
    return [
        (f"{image} (strip {name}, {camera})" if name else f"{image} ({camera})")
        + (": GNSS or INS rejected" if rejected else "")
        for image, name, camera, rejected in zip(*(strip[of].tolist() for of in _SHOWN), strict=True)
    ]


def _triangles(x: Floats, y: Floats, heading_deg: Floats, size: float) -> list[str]:
    """Path data of triangles (n,) that point along their headings; diamonds where these are not known."""
    angle = np.deg2rad(heading_deg)[:, None]
    ahead, aside = np.array([1.4, -1.0, -1.0]), np.array([0.0, 0.8, -0.8])
    corner_x = x[:, None] + size * (ahead * np.sin(angle) + aside * np.cos(angle))
    corner_y = y[:, None] + size * (-ahead * np.cos(angle) + aside * np.sin(angle))
    round_x, round_y = size * np.array([0.0, 1.0, 0.0, -1.0]), size * np.array([-1.0, 0.0, 1.0, 0.0])
    return [
        markup.path_of(corner_x[k], corner_y[k], closed=True)
        if np.isfinite(heading_deg[k])
        else markup.path_of(x[k] + round_x, y[k] + round_y, closed=True)
        for k in range(len(x))
    ]


def _strip_name(name: str, x: Floats, y: Floats) -> Markup:
    """The name of a strip before its first image."""
    ahead = np.array([x[-1] - x[0], y[-1] - y[0]])
    length = float(np.hypot(*ahead))
    back = -14.0 * ahead / length if length > 0 else np.array([0.0, -14.0])
    return markup.text(float(x[0] + back[0]), float(y[0] + back[1] + 4), name, css_class="halo")


def _surveyed(material: Material) -> pd.DataFrame:
    """Control and check points with plan coordinates, and their differences where they were used."""
    points = material.control_points
    points = points[points["x_m"].notna() & points["y_m"].notna()]
    found = pd.concat([material.differences(is_check) for is_check in (False, True)], ignore_index=True)
    joined = points[["point", "x_m", "y_m", "role"]].merge(
        found[["point", "dx_m", "dy_m", "dz_m", "is_check", "status"]], on="point", how="left"
    )
    joined["rejected"] = joined["status"].eq("rejected")
    joined["took_part"] = joined["is_check"].notna()
    # Without control as observations, a point of the role control is a check point.
    joined["is_check"] = np.where(
        joined["took_part"], joined["is_check"].eq(True), joined["role"].eq("check")
    )
    return joined


def _points(
    surveyed: pd.DataFrame, scale: ArrowScale | None, plot: MapPlot, y: float
) -> tuple[Markup, float]:
    """Symbols, arrows and their legend; returns the height under the legend too."""
    drawn = []
    for row in surveyed.to_dict("records"):
        place = plot.x.at(float(row["x_m"])), plot.y.at(float(row["y_m"]))
        took_part, is_check = bool(row["took_part"]), bool(row["is_check"])
        if scale is not None and took_part:
            drawn += arrows(row, place, scale)
        words = _words(row, is_check, took_part)
        drawn.append(symbol(place, is_check, took_part and not row["rejected"], words))
    x = plot.legend_x
    for is_check, took_part, words, width in (
        (False, True, "control point", 120.0),
        (True, True, "check point", 110.0),
        (False, False, "not used or rejected (hollow)", 220.0),
    ):
        drawn += [
            symbol((x + 7, y + 10), is_check, took_part, ""),
            markup.text(x + 20, y + 14, words, "start"),
        ]
        x += width
    if scale is not None:
        drawn.append(scale.legend(x + 10, y + 10))
    return markup.group("surveyed", drawn), y + 26


def _words(row: Mapping[Hashable, Any], is_check: bool, took_part: bool) -> str:
    """What the pointer shows at a control or check point."""
    kind = "check point" if is_check else "rejected control point" if row["rejected"] else "control point"
    if not took_part:
        return f"{kind} {row['point']}: not used"
    shown = [
        f"{name} {float(str(row[f'{name}_m'])):+z.3f} m"
        for name in ("dx", "dy", "dz")
        if np.isfinite(float(row[f"{name}_m"]))
    ]
    return f"{kind} {row['point']}: {', '.join(shown)}"
