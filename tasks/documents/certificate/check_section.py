"""Section of the checks: differences at control and at independent check points, and the statements.

Control of the calibration says how well it fits. Only independent check points carry a statement.
"""

from __future__ import annotations

import pandas as pd

from tasks.accuracy.check_points import check_point_differences
from tasks.accuracy.statement import AccuracyClass, statements
from tasks.document_kit.row_table import number_of, numbers_of, table_of, text_of
from tasks.document_kit.table import Row, Table, text_column
from tasks.documents.certificate.content import Block, Listing, Section, Sentences, Words, beside
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.georeferencing import check_tables
from tasks.documents.georeferencing.material import verdict
from tasks.documents.report.material import Material
from tasks.documents.report.surveyed_differences import (
    AXES,
    HEADINGS,
    STATISTICS_COLUMNS,
    difference_statistics,
    known_differences,
)
from tasks.georeferencing.point_differences import INDEPENDENT

MOST_POINTS = 200

_OF_CONTROL = (
    "control",
    "Control points of the calibration (not independent)",
    "The calibration was fitted to these points. Their differences show the quality of the fit, not the "
    "accuracy.",
)
_OF_CHECK = (
    "check",
    "Independent check points of the adjustment",
    "Their coordinates were not used in the adjustment; their image points were.",
)


def check_section(material: CertificateMaterial) -> Section:
    """Differences and statements."""
    results = material.results
    blocks: list[Block] = [
        Words(
            "Differences are computed − given, along east, north and up; RMS values are not centred.",
            "note",
        )
    ]
    control, check = (results.differences(is_check) for is_check in (False, True))
    blocks += beside(_listed(control, *_OF_CONTROL), _listed(check, *_OF_CHECK))
    if len(check):
        blocks.append(Sentences("Statements from the adjustment", _statements(results, check)))
    else:
        blocks.append(
            Words("The adjustment had no independent check points: no statement about accuracy is possible.")
        )
    blocks += _direct(material)
    return Section("checks", "Checks", tuple(blocks))


def _listed(table: pd.DataFrame, name: str, caption: str, note: str) -> Listing | None:
    return Listing(difference_table(name, caption, table, note)) if len(table) else None


def difference_table(name: str, caption: str, table: pd.DataFrame, note: str) -> Table:
    """RMS, mean and largest difference in metres and in GSD."""
    rows = [Row(key, (words, *cells)) for key, words, cells in difference_statistics(table)]
    rows.append(Row("points", ("points", *known_differences(table), "", "", "")))
    columns = (text_column("figure", ""), *STATISTICS_COLUMNS)
    return Table(f"{name}-differences", caption, columns, tuple(rows), note)


def _statements(results: Material, check: pd.DataFrame) -> tuple[str, ...]:
    """The sentences of the standards for the check points of the adjustment."""
    found = check_point_differences(check, results.control_points)
    asked = results.project.direct_georeferencing.accuracy_class_m
    wanted = None if asked is None else AccuracyClass(*asked)
    return tuple(statement.sentence for statement in statements(found, wanted))


def _direct(material: CertificateMaterial) -> list[Block]:
    """Direct georeferencing with this calibration, where it was checked."""
    check = material.check
    if check is None:
        return [Words("Direct georeferencing with this calibration was not checked.")]
    blocks: list[Block] = [Words(f"Direct georeferencing with this calibration. {verdict(check).sentence}")]
    independent, in_models, at_control = check_tables.difference_tables(check)
    both = (Listing(table) if table.rows else None for table in (independent, in_models))
    blocks += beside(*both)
    if at_control.rows:
        blocks.append(Listing(at_control))
    parallaxes = check_tables.parallax_table(check)
    if parallaxes.rows:
        blocks.append(Listing(parallaxes))
    sentences = tuple(statement.sentence for statement in check.figures.statements)
    if sentences:
        blocks.append(Sentences("Statements from direct georeferencing", sentences))
    return blocks


def point_section(material: CertificateMaterial) -> Section | None:
    """Annex: every control and check point; None without any."""
    results = material.results
    blocks: list[Block] = []
    for name, caption, is_check in (
        ("control-points", _OF_CONTROL[1], False),
        ("check-points", _OF_CHECK[1], True),
    ):
        table = results.differences(is_check)
        if len(table):
            blocks.append(Listing(point_table(name, caption, table)))
    if material.check is not None and len(material.check.points):
        points = material.check.points
        own = points[points["status"] == INDEPENDENT]
        if len(own):
            caption = "Independent check points, direct georeferencing"
            blocks.append(Listing(point_table("direct-points", caption, own)))
    return Section("points", "Annex: surveyed points", tuple(blocks)) if blocks else None


def point_table(name: str, caption: str, table: pd.DataFrame) -> Table:
    """One row for each point by name: differences, their predicted σ, and the rays."""
    listed = table.sort_values("point", kind="stable").head(MOST_POINTS)
    note = "" if len(listed) == len(table) else f"The first {len(listed)} of {len(table):,} by name."
    shown = (
        text_of("point", "point"),
        *numbers_of("{}_m", [f"d {h}" for h in HEADINGS], "m", AXES, 3, plus=True),
        *numbers_of("sigma_{}_m", [f"σ {h}" for h in HEADINGS], "m", AXES, 3),
        number_of("rays", "rays"),
    )
    return table_of(name, caption, shown, listed, "{point}", note)
