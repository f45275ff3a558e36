"""Section of the calibration flight: its facts, its levels, its map, and the use of its exposures."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tasks.coordinates.crs import MapFrame
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Number, Row, Table, numbers, text_column
from tasks.documents.certificate.content import Block, Fact, Facts, Figure, Listing, Section
from tasks.documents.certificate.flight_geometry import StripGroup, strip_groups
from tasks.documents.certificate.flight_map import flight_map
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


def _words_of_group(group: StripGroup) -> str:
    return f"level {group.level + 1}, {group.axis_deg:.0f}° and {group.axis_deg + 180.0:.0f}°"


_STRIP_GROUP = (
    text_of("group", "height level, axis of the strips", _words_of_group),
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
    delivered = material.exposures[material.exposures["camera"].isin(names)]["image"]
    oriented = set(material.images["image"])
    in_block = set(results.images["image"])
    measured = set(results.image_points["image"])
    out = [name for name in delivered if name not in oriented]
    rows = [
        _row("delivered", "delivered", delivered, named=False),
        _row("used", "used", [name for name in delivered if name in oriented], named=False),
        _row("not_used", "not used", out, named=False),
        _row(
            "without_points",
            "not used: no image point is measured in it",
            [n for n in out if n not in measured],
        ),
        _row(
            "without_orientation",
            "not used: incomplete, and cannot be oriented by its image points",
            [name for name in out if name in measured and name not in in_block],
        ),
        _row(
            "not_adjusted",
            "not used: not oriented by the adjustment",
            [name for name in out if name in in_block],
        ),
        _row("few_points", f"used with fewer than {_FEW_POINTS} image points", _few(material)),
    ]
    for group, words in _OBSERVED:
        of_group = results.residuals[results.residuals["group"] == group]
        rejected = set(of_group.loc[of_group["status"] == "rejected", "image"])
        lacking = set(of_group.loc[~of_group["status"].isin((*TOOK_PART, "rejected")), "image"])
        observed = set(of_group["image"]) - lacking
        used = [name for name in delivered if name in oriented]
        if material.record.heads:
            # An event is observed once, which is listed under one of its images.
            used = [name for name in used if name in set(of_group["image"])]
        rows += [
            _row(
                f"{group}_rejected",
                f"used, {words} rejected as gross error",
                [name for name in used if name in rejected],
            ),
            _row(
                f"{group}_missing",
                f"used without {words}",
                [name for name in used if name not in observed and name not in rejected],
            ),
        ]
    columns = (
        text_column("use", "exposures"),
        Column("count", "number"),
        text_column("names", "which"),
    )
    # A reason without an exposure says nothing.
    shown = tuple(row for row in rows if row.key in _ALWAYS or row.cells[2])
    return Table("exposures", "Exposures used and not used", columns, shown)


def _few(material: CertificateMaterial) -> list[str]:
    """Oriented images with few points that were used."""
    own = material.results.residuals
    own = own[(own["group"] == IMAGE_POINTS) & (own["component"] == "x") & own["status"].isin(TOOK_PART)]
    counts = own.groupby("image")["point"].size()
    return [name for name in material.images["image"] if counts.get(name, 0) < _FEW_POINTS]


def _row(key: str, words: str, names: pd.Series | list[str], *, named: bool = True) -> Row:
    listed = sorted(names)
    text = ", ".join(listed[:_MOST_NAMES]) if named else ""
    if named and len(listed) > _MOST_NAMES:
        text += f" and {len(listed) - _MOST_NAMES:,} more"
    return Row(key, (words, Number(len(listed)), text))
