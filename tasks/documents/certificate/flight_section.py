"""Section of the calibration flight: its facts, its levels, its map, and the use of its exposures.

The map draws strips as arrows next to their lines, by height level, and the points.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.difference_arrows import symbol
from tasks.document_kit.map_plot import MapPlot
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Number, Row, Table, numbers, text_column
from tasks.documents.certificate.content import Block, Fact, Facts, Figure, Listing, Section
from tasks.documents.certificate.flight_geometry import StripGroup, strip_groups
from tasks.documents.certificate.identity_section import NOT_DECLARED
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.material import IMAGE_POINTS, TOOK_PART


def flight_section(material: CertificateMaterial) -> Section:
    """When, how and over which control the flight was flown."""
    blocks: list[Block] = [
        Facts("flight", "", _facts(material)),
        Listing(level_table(material)),
        Listing(strip_group_table(material)),
        Listing(exposure_table(material)),
    ]
    if len(material.images):
        caption = (
            "Flight pattern. Each strip is drawn to the right of its line, seen in the direction of flight, "
            "so that a line flown forward and reverse shows two arrows. Dots are exposures, triangles "
            "control points, circles check points."
        )
        blocks.append(
            Figure(
                "flight-pattern",
                caption,
                "Map of the flight strips with control and check points",
                flight_map(material),
            )
        )
    return Section("flight", "Calibration flight", tuple(blocks))


def _facts(material: CertificateMaterial) -> tuple[Fact, ...]:
    flight, settings = material.record.flight, material.results.project.project
    flown = NOT_DECLARED if flight.flown is None else flight.flown.isoformat()
    frame = MapFrame.of(settings.crs, settings.heights).description
    facts = [
        Fact("project", "project", (flight.project,)),
        Fact("flown", "date of the flight", (flown,)),
        Fact("frame", "coordinate reference system", (frame,)),
        Fact("images", "images", (Number(flight.images),)),
        Fact("strips", "strips", (Number(flight.strips),)),
        Fact("heights_m", "flying heights above ground", numbers(flight.heights_m, 0), "m"),
        Fact("ground_m", "height of the ground (median)", (Number(_ground(material), 0),), "m"),
        Fact("gsd_m", "ground sampling distance", numbers((g * 100 for g in flight.gsd_m), 1), "cm"),
        Fact("headings_deg", "flight directions", numbers(flight.headings_deg, 0), "°"),
        Fact("object_points", "object points", (Number(flight.object_points),)),
        Fact("image_points", "image points", (Number(flight.image_points),)),
        Fact("control_points", "control points", (Number(flight.control_points),)),
    ]
    return tuple(facts)


def _ground(material: CertificateMaterial) -> float | None:
    """Median height of the ground under the images, metres; None without images."""
    ground = material.images["ground_m"]
    return float(ground.median()) if len(ground) else None


def level_table(material: CertificateMaterial) -> Table:
    """One row for each flying height: GSD, images, strips and directions."""
    columns = (
        text_column("level", "height level"),
        Column("height_m", "height above ground", "m"),
        Column("altitude_m", "altitude", "m"),
        Column("gsd_cm", "GSD", "cm"),
        Column("scale", "image scale 1 :"),
        Column("images", "images"),
        Column("strips", "strips"),
        text_column("directions", "flight directions (strips)"),
    )
    flight = material.record.flight
    rows = []
    for level, (height, gsd) in enumerate(zip(flight.heights_m, flight.gsd_m, strict=True)):
        images = material.images[material.images["level"] == level]
        cells: tuple[Cell, ...] = (
            f"level {level + 1}",
            Number(height, 0),
            Number(float(images["z_m"].median()), 0),
            Number(gsd * 100.0, 1),
            Number(gsd / (material.record.camera.pixel_um * 1e-6), 0),
            Number(len(images)),
            Number(images["strip"].nunique()),
            _directions(images, flight.headings_deg),
        )
        rows.append(Row(f"level-{level + 1}", cells))
    note = "Altitude: median of the projection centres in the height system of the project."
    return Table("levels", "Height levels, as found in the data", columns, tuple(rows), note)


def strip_group_table(material: CertificateMaterial) -> Table:
    """One row for each height and axis of flight: bases, overlaps and line spacing."""
    note = (
        "Medians, from the adjusted projection centres. Axes are those of the map; strips of a single "
        "exposure are excluded. Overlaps refer to the median terrain height; strips on the same line count "
        "as one line."
    )
    groups = strip_groups(material.images_of_strips, material.record.camera)
    return table_of("strip-groups", "Overlaps and bases", _STRIP_GROUP, groups, _key_of_group, note)


def _key_of_group(group: StripGroup) -> str:
    return f"level-{group.level + 1}@{group.axis_deg:.0f}"


def axis_words(group: StripGroup) -> str:
    """The height level and both directions of a group of strips, 0° to 359°."""
    axis = round(group.axis_deg) % 180
    return f"level {group.level + 1}, {axis}° and {axis + 180}°"


_STRIP_GROUP = (
    text_of("group", "height level, axis of the strips", axis_words),
    number_of("images", "images"),
    number_of("strips", "strips"),
    number_of("lines", "lines"),
    number_of("height_m", "height above ground", "m"),
    number_of("base_m", "base", "m"),
    number_of("base_over_height", "base / height", decimals=2),
    number_of("forward_overlap", "forward overlap", "%", factor=100.0),
    number_of("spacing_m", "line spacing", "m"),
    number_of("side_overlap", "side overlap", "%", factor=100.0),
)


def _directions(images: pd.DataFrame, known: tuple[float, ...]) -> str:
    """Directions of the record with the number of their strips: ``90° (7), 270° (7)``."""
    found: list[float] = []
    for _, strip in images.groupby("strip", sort=True):
        angle = np.deg2rad(strip["heading_deg"].dropna().to_numpy(np.float64))
        if len(angle) and known:
            mean = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean())
            found.append(min(known, key=lambda heading: -np.cos(np.deg2rad(heading) - mean)))
    return ", ".join(f"{heading:.0f}° ({found.count(heading)})" for heading in known if heading in found)


_MOST_NAMES = 12
# An image of fewer points is oriented by GNSS and INS almost alone.
_FEW_POINTS = 6
_ALWAYS = ("delivered", "used", "not_used")
_OBSERVED = (("gnss_positions", "GNSS position"), ("ins_attitudes", "INS attitude"))


def exposure_table(material: CertificateMaterial) -> Table:
    """Delivered and used exposures, and how many are not used or lack something, for which reason."""
    results, names = material.results, material.record.names
    delivered = set(material.exposures[material.exposures["camera"].isin(names)]["image"])
    used, in_block = delivered & set(material.images["image"]), set(results.images["image"])
    out, measured = delivered - used, set(results.image_points["image"])
    rows = [
        _row("delivered", "delivered", delivered, named=False),
        _row("used", "used", used, named=False),
        _row("not_used", "not used", out, named=False),
        _row("without_points", "not used: no image point is measured in it", out - measured),
        _row(
            "without_orientation",
            "not used: incomplete, and cannot be oriented by its image points",
            (out & measured) - in_block,
        ),
        _row("not_adjusted", "not used: not oriented by the adjustment", out & in_block),
        _row("few_points", f"used with fewer than {_FEW_POINTS} image points", _few(material)),
    ]
    for group, words in _OBSERVED:
        of_group = results.residuals[results.residuals["group"] == group]
        rejected = set(of_group.loc[of_group["status"] == "rejected", "image"])
        lacking = set(of_group.loc[~of_group["status"].isin((*TOOK_PART, "rejected")), "image"])
        observed = set(of_group["image"])
        # An event of a rig is observed once, which is listed under one of its images.
        own = used & observed if material.record.heads else used
        rows += [
            _row(f"{group}_rejected", f"used, {words} rejected as gross error", own & rejected),
            _row(f"{group}_missing", f"used without {words}", own - (observed - lacking) - rejected),
        ]
    columns = (text_column("use", "exposures"), Column("count", "number"), text_column("names", "which"))
    # A reason without an exposure says nothing.
    shown = tuple(row for row in rows if row.key in _ALWAYS or row.cells[2])
    return Table("exposures", "Exposures used and not used", columns, shown)


def _few(material: CertificateMaterial) -> list[str]:
    """Oriented images with few points that were used."""
    own = material.results.residuals
    own = own[(own["group"] == IMAGE_POINTS) & (own["component"] == "x") & own["status"].isin(TOOK_PART)]
    counts = own.groupby("image")["point"].size()
    return [name for name in material.images["image"] if counts.get(name, 0) < _FEW_POINTS]


def _row(key: str, words: str, names: Collection[str], *, named: bool = True) -> Row:
    listed = sorted(names)
    text = ", ".join(listed[:_MOST_NAMES]) if named else ""
    if named and len(listed) > _MOST_NAMES:
        text += f" and {len(listed) - _MOST_NAMES:,} more"
    return Row(key, (words, Number(len(listed)), text))


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
    parts.append(_legend(material, points, plot.legend_x, y))
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
    drawn = []
    if len(x) > 1 or np.isfinite(ahead).all():
        end = np.array([x[-1] + 1.2 * _HEAD * ahead[0], y[-1] + 1.2 * _HEAD * ahead[1]])
        line = markup.path_of(np.append(x, end[0]), np.append(y, end[1]))
        drawn.append(markup.element("path", css="flown", stroke=colour, d=line))
        drawn.append(markup.element("path", fill=colour, d=_head(end, ahead)))
    for a, b in zip(x, y, strict=True):
        drawn.append(markup.circle(float(a), float(b), 1.5, fill=colour))
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
        line = f"M{markup.number(x)},{markup.number(y)}h26"
        parts += [markup.element("path", css="flown", stroke=colour, d=line)]
        parts += [markup.text(x + 34, y + 4, words, "start")]
        x += 60 + 6.8 * len(words)
    for is_check, words in ((False, "control point"), (True, "check point")):
        if (points["is_check"] == is_check).any():
            parts += [symbol((x + 6, y), is_check, True, ""), markup.text(x + 18, y + 4, words, "start")]
            x += 40 + 6.8 * len(words)
    return markup.group("legend", parts)
