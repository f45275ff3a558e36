"""georeferencing_check.html: the page of a direct-georeferencing check, and its map by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from tasks.coordinates.crs import MapFrame
from tasks.georeferencing.report import check_tables, parallax_plots
from tasks.georeferencing.report.difference_map import difference_map
from tasks.georeferencing.report.material import CheckMaterial, read_check
from tasks.georeferencing.report.verdict import verdict
from tasks.report.export import figure_of
from tasks.report.key_figures import gate_table
from tasks.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.report.provenance import SOFTWARE, files_table, settings_table, versions_table
from tasks.settings.project import Project
from tasks.storage.artifact import Artifact
from tasks.storage.store import stored

PAGE = "georeferencing_check.html"
#: The map of the differences; only where there are surveyed points.
MAP = "georeferencing_map.svg"
_TEMPLATES = Path(__file__).parent / "templates"


@stored("georeferencing_page")
def write_georeferencing_page(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    project: Project,
    name: str,
    files: tuple[str, ...],
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write georeferencing_check.html, and georeferencing_map.svg if there is anything to show.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    project : the settings, which the page shows; its gates are tested.
    name : the project's name (it is not part of the settings' content).
    files : names of the delivered files, without folders.
    software : versions that decide how the page looks.
    """
    material = read_check(stages, project)
    page = render(material, name, files, software)
    (folder / PAGE).write_text(page, encoding="utf-8")
    if len(material.points):
        (folder / MAP).write_text(figure_of(page, "differences"), encoding="utf-8")


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
        _environment()
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
    plots = {}
    if len(material.points):
        plots["differences"] = difference_map(material)
    if material.figures.y_parallaxes:
        plots["parallaxes"] = parallax_plots.parallax_map(material)
        plots["histogram"] = parallax_plots.parallax_histogram(material)
    return plots


@cache
def _environment() -> Environment:
    """Templates with escaping on for everything; macros and style are those of the report."""
    return Environment(
        loader=FileSystemLoader([_TEMPLATES, REPORT_TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
