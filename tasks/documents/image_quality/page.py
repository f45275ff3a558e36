"""image_quality.html as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from markupsafe import Markup

from tasks.document_kit.table import Table
from tasks.document_kit.templates import rendered
from tasks.documents.image_quality import plots
from tasks.documents.image_quality.material import QualityMaterial, SceneMaterial
from tasks.documents.image_quality.quality_tables import (
    change_table,
    column_table,
    drift_table,
    mean_table,
    motion_table,
    noise_table,
    pixel_table,
    refused_table,
    sheet_table,
    smear_table,
    transfer_table,
)
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.report.provenance import files_table, settings_table, versions_table

_TEMPLATES = Path(__file__).parent / "templates"


def render(material: QualityMaterial, name: str, software: Mapping[str, str]) -> str:
    """The page."""
    settings, scenes, sensor = material.settings, material.scenes, material.sensor
    tables: list[Table] = [
        settings_table(settings),
        files_table(settings, [path.name for path in settings.input_files()]),
        versions_table(software),
    ]
    if scenes is not None:
        tables += [mean_table(scenes), smear_table(scenes), refused_table(scenes), noise_table(scenes)]
    if material.drift is not None and material.changes is not None:
        tables += [drift_table(material.drift), change_table(material.changes)]
    if material.motion is not None:
        tables.append(motion_table(material.motion))
    if sensor is not None:
        tables += [sheet_table(sensor), pixel_table(sensor), column_table(sensor), transfer_table(sensor)]
    return rendered(
        "image_quality.html.j2",
        _TEMPLATES,
        REPORT_TEMPLATES,
        name=name,
        line=_line(scenes),
        verdict=" ".join(_verdicts(material)),
        problems=material.problems,
        tables={table.name: table for table in tables},
        plots=_plots(material),
        edge_maps={} if scenes is None else plots.edge_maps(scenes),
    )


def _line(scenes: SceneMaterial | None) -> str:
    if scenes is None:
        return "Sensor"
    columns, rows = scenes.size
    return f"Images: {scenes.figures['images']} of {columns:,} × {rows:,} pixels, {scenes.figures['dtype']}"


def _verdicts(material: QualityMaterial) -> Iterator[str]:
    """The factors of the bands, and whether the sensor meets its thresholds."""
    if material.scenes is not None and not len(material.scenes.whole):
        yield "No edge could be measured."
    elif material.scenes is not None:
        words = [
            f"band {row['band']}: {row['factor']:.3f} ± {row['sigma_factor']:.3f}"
            for _, row in material.scenes.whole.iterrows()
        ]
        yield f"Factor of effective resolution: {', '.join(words)}."
    if material.sensor is not None:
        passed = bool(material.sensor.figures["passed"])
        yield "The sensor meets all thresholds." if passed else "The sensor does not meet all thresholds."


def _plots(material: QualityMaterial) -> dict[str, Markup]:
    """The plots for which there is something to show."""
    drawn = {}
    scenes, sensor = material.scenes, material.sensor
    if scenes is not None and len(scenes.edges):
        drawn["responses"] = plots.response_plot(scenes)
    if scenes is not None and len(scenes.noise):
        drawn["noise"] = plots.noise_plot(scenes)
    if sensor is not None and len(sensor.transfer):
        drawn["transfer"] = plots.transfer_plot(sensor)
    if sensor is not None and len(sensor.aperture):
        drawn["aperture"] = plots.aperture_plot(sensor)
    return drawn
