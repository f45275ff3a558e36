"""image_quality.html as text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from tasks.document_kit.table import Table
from tasks.documents.image_quality import plots
from tasks.documents.image_quality.material import QualityMaterial
from tasks.documents.image_quality.quality_tables import mean_table, noise_table, refused_table
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.report.provenance import files_table, settings_table, versions_table

_TEMPLATES = Path(__file__).parent / "templates"


def render(material: QualityMaterial, name: str, software: Mapping[str, str]) -> str:
    """The page."""
    settings = material.settings
    tables: tuple[Table, ...] = (
        mean_table(material),
        refused_table(material),
        noise_table(material),
        settings_table(settings),
        files_table(settings, [path.name for path in settings.input_files()]),
        versions_table(software),
    )
    page: str = (
        _environment()
        .get_template("image_quality.html.j2")
        .render(
            name=name,
            line=_line(material),
            verdict=_verdict(material),
            problems=material.problems,
            tables={table.name: table for table in tables},
            plots=_plots(material),
        )
    )
    return page


def _line(material: QualityMaterial) -> str:
    columns, rows = material.size
    return (
        f"{material.figures['images']} images of {columns:,} × {rows:,} pixels, {material.figures['dtype']}"
    )


def _verdict(material: QualityMaterial) -> str:
    """The factors of the bands in a sentence."""
    if not len(material.whole):
        return "No edge could be measured."
    words = [
        f"band {row['band']}: {row['factor']:.2f} ± {row['sigma_factor']:.3f}"
        for _, row in material.whole.iterrows()
    ]
    return f"Factor of effective resolution: {', '.join(words)}."


def _plots(material: QualityMaterial) -> dict[str, Markup]:
    """The plots for which there is something to show."""
    drawn = {}
    if len(material.edges):
        drawn["edges"] = plots.edge_map(material)
        drawn["responses"] = plots.response_plot(material)
    if len(material.noise):
        drawn["noise"] = plots.noise_plot(material)
    return drawn


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
