"""The map of the flight pattern: strips as arrows next to their lines, by height level, and the points."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.difference_arrows import symbol
from tasks.document_kit.map_plot import MapPlot
from tasks.documents.certificate.material import CertificateMaterial

#: Drawing units between a line and the strip flown along it.
BESIDE = 4.5
_HEAD = 9.0


def flight_map(material: CertificateMaterial) -> Markup:
    """The map with its legend; needs at least one image."""
    images, points = material.images, _surveyed(material)
    places = np.vstack([table[["x_m", "y_m"]].to_numpy(np.float64) for table in (images, points)])
    plot = MapPlot.over(places[:, 0], places[:, 1], margin=0.06)
    parts = [plot.axes()]
    for level, own in images.groupby("level", sort=True):
        colour = palette.category(int(str(level)))
        strips = [strip_beside_its_line(strip, plot, colour) for _, strip in own.groupby("strip")]
        parts.append(markup.group("strips", strips))
    for row in points.to_dict("records"):
        place = plot.x.at(float(row["x_m"])), plot.y.at(float(row["y_m"]))
        parts.append(symbol(place, bool(row["is_check"]), bool(row["took_part"]), str(row["point"])))
    y = plot.bottom + 14
    parts.append(_legend(material, points, plot.x.start, y))
    return markup.svg(axes.WIDTH, y + 24, "Map of the flight pattern", markup.group("pattern", parts))


def _surveyed(material: CertificateMaterial) -> pd.DataFrame:
    """Surveyed points in plan: whether each is a check point, and whether it was used."""
    points = material.results.control_points
    points = points[points["x_m"].notna() & points["y_m"].notna()]
    table = material.results.control_residuals
    control, rejected = set(table["point"]), set(table.loc[table["status"] == "rejected", "point"])
    check = set(material.results.check_points["point"])
    if material.check is not None:
        check |= set(material.check.points["point"]) - control
    return points[["point", "x_m", "y_m"]].assign(
        is_check=[
            name in check or (role == "check" and name not in control)
            for name, role in zip(points["point"], points["role"], strict=True)
        ],
        took_part=points["point"].isin((control - rejected) | check),
    )


def strip_beside_its_line(strip: pd.DataFrame, plot: MapPlot, colour: str) -> Markup:
    """A strip next to its line: dots at its exposures, an arrow head at its end."""
    x, y = plot.x.of(strip["x_m"].to_numpy(np.float64)), plot.y.of(strip["y_m"].to_numpy(np.float64))
    ahead = _ahead(strip, x, y)
    # To the right of the direction of flight; y of the drawing points down.
    x, y = x - BESIDE * ahead[1], y + BESIDE * ahead[0]
    order = np.argsort(x * ahead[0] + y * ahead[1], kind="stable")
    x, y = x[order], y[order]
    style: dict[str, markup.Attribute] = {"class": "flown", "stroke": colour}
    drawn = []
    if len(x) > 1 or np.isfinite(ahead).all():
        end = np.array([x[-1] + 1.2 * _HEAD * ahead[0], y[-1] + 1.2 * _HEAD * ahead[1]])
        line = markup.path_of(np.append(x, end[0]), np.append(y, end[1]))
        drawn.append(markup.element("path", {**style, "d": line}))
        drawn.append(markup.element("path", {"fill": colour, "d": _head(end, ahead)}))
    for a, b in zip(x, y, strict=True):
        drawn.append(markup.element("circle", {"cx": float(a), "cy": float(b), "r": "1.5", "fill": colour}))
    return markup.group("flown-strip", drawn)


def _ahead(strip: pd.DataFrame, x: Floats, y: Floats) -> Floats:
    """Unit vector of the flight in the drawing: its heading along the line of the exposures."""
    heading = np.deg2rad(strip["heading_deg"].dropna().to_numpy(np.float64))
    flown = np.array([np.sin(heading).sum(), -np.cos(heading).sum()])
    line = np.array([x[-1] - x[0], y[-1] - y[0]])
    if np.hypot(*line) < 1e-9:
        line = flown if np.hypot(*flown) > 0.0 else np.array([0.0, -1.0])
    if line @ flown < 0.0:
        line = -line
    return np.asarray(line / np.hypot(*line))


def _head(tip: Floats, ahead: Floats) -> str:
    """Path data of an arrow head."""
    across = np.array([-ahead[1], ahead[0]])
    corners = np.array(
        [tip, tip - _HEAD * ahead + 0.4 * _HEAD * across, tip - _HEAD * ahead - 0.4 * _HEAD * across]
    )
    return markup.path_of(corners[:, 0], corners[:, 1], closed=True)


def _legend(material: CertificateMaterial, points: pd.DataFrame, x: float, y: float) -> Markup:
    """Levels with their height and number of images, and the symbols of the points."""
    parts = []
    heights = material.record.flight.heights_m
    for level, own in material.images.groupby("level", sort=True):
        height = heights[int(str(level))] if heights else float((own["z_m"] - own["ground_m"]).median())
        words = f"{height:,.0f} m: {own['strip'].nunique()} strips, {len(own)} images"
        colour = palette.category(int(str(level)))
        line = {"class": "flown", "stroke": colour, "d": f"M{markup.number(x)},{markup.number(y)}h26"}
        parts += [markup.element("path", line), markup.text(x + 34, y + 4, words, "start")]
        x += 60 + 6.8 * len(words)
    for is_check, words in ((False, "control point"), (True, "check point")):
        if (points["is_check"] == is_check).any():
            parts += [symbol((x + 6, y), is_check, True, ""), markup.text(x + 18, y + 4, words, "start")]
            x += 40 + 6.8 * len(words)
    return markup.group("legend", parts)
