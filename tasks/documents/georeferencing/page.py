"""georeferencing_check.html: the page of a direct-georeferencing check, and its map as a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from tasks.coordinates.crs import MapFrame
from tasks.document_kit.templates import templates
from tasks.documents.georeferencing import check_tables, plots
from tasks.documents.georeferencing.material import CheckMaterial
from tasks.documents.georeferencing.verdict import verdict
from tasks.documents.report.key_figures import gate_table
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.report.provenance import files_table, settings_table, versions_table

_TEMPLATES = Path(__file__).parent / "templates"


def render(material: CheckMaterial, name: str, files: Sequence[str], software: Mapping[str, str]) -> str:
    """The page as text."""
    project = material.project
    tables = (
        *check_tables.difference_tables(material),
        check_tables.source_table(material),
        check_tables.point_table(material),
        check_tables.statement_table(material),
        check_tables.parallax_table(material),
        check_tables.model_table(material),
        check_tables.calibration_table(material),
        gate_table(material.summary.gates),
        settings_table(project),
        files_table(project, files),
        versions_table(software),
    )
    page: str = (
        templates(_TEMPLATES, REPORT_TEMPLATES)
        .get_template("georeferencing_check.html.j2")
        .render(
            name=name,
            frame=MapFrame.of(project.project.crs, project.project.heights).description,
            verdict=verdict(material),
            problems=material.summary.problems,
            figures=material.figures,
            tables={table.name: table for table in tables},
            plots=_plots(material),
        )
    )
    return page


def _plots(material: CheckMaterial) -> dict[str, Markup]:
    """The plots for which there is something to show."""
    drawn = {}
    if len(material.points):
        drawn["differences"] = plots.difference_map(material)
    if material.figures.y_parallaxes:
        drawn["parallaxes"] = plots.parallax_map(material)
        drawn["histogram"] = plots.parallax_histogram(material)
    return drawn
