"""From the material to the page: every table and plot is made here, the templates place them among words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from tasks.report import (
    block_map,
    datum,
    histogram,
    key_figures,
    orientation_precision,
    point_precision,
    provenance,
    residual_field,
    surveyed_points,
    suspicious,
    system_parameters,
)
from tasks.report.material import IMAGE_POINTS, Material
from tasks.report.table import Table

#: Package data: part of the digest of every source that reaches this module.
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Plot:
    """A drawing with the name the templates call it by."""

    name: str
    drawing: Markup


def render(material: Material, name: str, files: Sequence[str], software: Mapping[str, str]) -> str:
    """The page as text.

    Parameters
    ----------
    material : tables and figures.
    name : the project's name.
    files : names of the delivered files in the order of the settings.
    software : versions besides those of the numerical libraries.
    """
    tables = {table.name: table for table in _tables(material, files, software)}
    plots = {plot.name: plot.drawing for plot in _plots(material)}
    fields = residual_field.residual_fields(material)
    page: str = (
        _environment()
        .get_template("page.html.j2")
        .render(
            name=name,
            frame=material.figures.frame,
            verdict=key_figures.verdict(material),
            problems=material.summary.problems,
            figures=material.figures,
            summary=material.summary,
            tables=tables | {"image-residuals": residual_field.field_table(fields)},
            plots=plots,
            fields=[(field, residual_field.field_plot(field)) for field in fields],
            outlined=len(material.oriented) <= block_map.MOST_OUTLINES,
            least_in_cell=residual_field.LEAST_IN_CELL,
        )
    )
    return page


def _tables(material: Material, files: Sequence[str], software: Mapping[str, str]) -> tuple[Table, ...]:
    return (
        key_figures.key_table(material),
        key_figures.group_table(material),
        key_figures.gate_table(material),
        histogram.standardized_table(material),
        surveyed_points.statistics(material),
        surveyed_points.point_table(material, is_check=False),
        surveyed_points.point_table(material, is_check=True),
        orientation_precision.orientation_table(material),
        point_precision.point_table(material),
        system_parameters.parameter_table(material),
        datum.datum_table(material),
        suspicious.rejected_table(material),
        suspicious.uncontrolled_images(material),
        suspicious.uncontrolled_table(material),
        provenance.settings_table(material.project),
        provenance.files_table(material.project, files),
        provenance.versions_table(software),
    )


def _plots(material: Material) -> list[Plot]:
    """The plots for which there is something to show."""
    made = {
        "block": block_map.block_map(material),
        "orientations": orientation_precision.orientation_plot(material),
        "heights": point_precision.height_precision_map(material) if len(material.object_points) else None,
        "histogram": histogram.histogram_plot(material)
        if len(histogram.standardized(material, IMAGE_POINTS))
        else None,
        "correlations": system_parameters.correlation_plot(material),
        "datum": datum.datum_plot(material),
    }
    return [Plot(name, drawing) for name, drawing in made.items() if drawing is not None]


@cache
def _environment() -> Environment:
    """Templates with escaping on for everything: names come from files."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
