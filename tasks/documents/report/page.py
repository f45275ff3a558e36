"""From the material to the page: every table and plot is made here; the templates place them in the text."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from markupsafe import Markup

from tasks.document_kit.table import Table
from tasks.document_kit.templates import rendered
from tasks.documents.report import (
    block_map,
    calibration,
    causes,
    correlations,
    datum,
    first_screen,
    histogram,
    image_errors,
    image_errors_plot,
    key_figures,
    model_tests,
    orientation_precision,
    point_precision,
    provenance,
    residual_correlation,
    residual_field,
    residual_tables,
    rig_heads,
    self_calibration,
    statements,
    strip_differences,
    surveyed_points,
    system_parameters,
    trajectories,
    trust_map,
    two_step,
    virtual_image,
)
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.documents.report.residual_field import ResidualField

#: Package data: part of the digest of every source that reaches this module.
TEMPLATES = Path(__file__).parent / "templates"
#: What makes lists searchable. The page allows this very text and no other script.
_SCRIPT = (TEMPLATES / "lists.js").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Plot:
    """A drawing with the name the templates call it by."""

    name: str
    drawing: Markup


def render(
    material: Material, name: str, files: Sequence[str], software: Mapping[str, str], flown: str = ""
) -> str:
    """The page as text.

    Parameters
    ----------
    material : tables and figures.
    name : the project's name.
    files : names of the delivered files in the order of the settings.
    software : versions besides those of the numerical libraries.
    flown : date of the flight; empty: not known.
    """
    found = causes.causes(material)
    tables = {table.name: table for table in _tables(material, files, software)}
    plots = {plot.name: plot.drawing for plot in _plots(material, found)}
    fields = residual_field.residual_fields(material)
    errors = image_errors.image_errors(material)
    pairs = image_errors_plot.before_and_after(material)
    composed = virtual_image.virtual_images(material)
    of_errors = (image_errors.errors_table(errors), image_errors_plot.comparison_table(pairs))
    of_rigs = (*rig_heads.head_tables(material), rig_heads.platform_table(material))
    of_rigs = (*of_rigs, virtual_image.virtual_image_table(composed))
    added = (*of_errors, *of_rigs, *_residual_tables(material, fields))
    tables |= {table.name: table for table in added}
    named, tables = first_screen.places(material, found, tables, plots["block"])
    return rendered(
        "page.html.j2",
        TEMPLATES,
        name=name,
        frame=material.figures.frame,
        verdict=key_figures.verdict(material, found),
        rejection_note=key_figures.rejection_note(material.figures),
        causes=named,
        more_causes=len(causes.by_place(found)) - len(named),
        cards=first_screen.cards(material),
        version=software.get("aerocal", ""),
        flown=flown,
        problems=causes.remarks(material, found),
        against=calibration.against(material, [sentence for place in named for sentence in place.sentences]),
        figures=material.figures,
        summary=material.summary,
        tables=tables,
        plots=plots,
        fields=[(field, _field_plots(field)) for field in fields],
        confidence=material.project.adjustment.confidence,
        calibrated=not material.self_calibration.empty,
        image_errors=[
            (own, image_errors_plot.errors_plot(own), image_errors_plot.parts_plot(own)) for own in errors
        ],
        comparisons=[drawn for pair in pairs if (drawn := image_errors_plot.comparison_plot(pair))],
        has_heads=rig_heads.has_heads(material),
        head_tables=rig_heads.HEAD_TABLES,
        heads_note=rig_heads.HEADS_NOTE,
        virtual_images=[(image.name, virtual_image.virtual_image_plot(image)) for image in composed],
        script=Markup(_SCRIPT),
        script_digest=b64encode(sha256(_SCRIPT.encode()).digest()).decode(),
        arrows_of_images='<g class="positions"' in plots["block"],
        outlined=len(material.oriented) <= block_map.MOST_OUTLINES,
    )


def _tables(material: Material, files: Sequence[str], software: Mapping[str, str]) -> tuple[Table, ...]:
    by_image = residual_tables.residuals_by_image(material)
    return (
        key_figures.key_table(material),
        key_figures.group_table(material),
        key_figures.gate_table(material.summary.gates),
        statements.figures_table(material.figures.accuracy_statements),
        histogram.standardized_table(material),
        surveyed_points.statistics(material),
        surveyed_points.check_test_table(material),
        surveyed_points.point_table(material, is_check=False),
        surveyed_points.point_table(material, is_check=True),
        surveyed_points.distance_table(material),
        orientation_precision.orientation_table(material),
        orientation_precision.orientation_list(material),
        orientation_precision.neighbour_table(material),
        residual_tables.worst_table(material),
        residual_tables.image_table(by_image),
        *residual_tables.strip_tables(by_image),
        point_precision.point_table(material),
        trust_map.trust_map_table(material),
        trust_map.limits_table(material),
        system_parameters.parameter_table(material),
        system_parameters.registered_table(material),
        self_calibration.offered_table(material),
        self_calibration.group_table(material),
        self_calibration.flight_table(material),
        *calibration.calibration_tables(material),
        *two_step.two_step_tables(material.figures.two_step),
        datum.datum_table(material),
        model_tests.strongest_table(material),
        model_tests.unnoticed_table(material),
        residual_tables.rejected_table(material),
        residual_tables.uncontrolled_images(material),
        residual_tables.uncontrolled_table(material),
        provenance.settings_table(material.project),
        provenance.files_table(material.project, files),
        provenance.versions_table(software),
    )


def _residual_tables(material: Material, fields: Sequence[ResidualField]) -> tuple[Table, ...]:
    """Figures of the residuals of each camera, and their use as corrections."""
    of_cameras = residual_field.field_table(fields, material.project.adjustment.confidence)
    iteration = material.figures.residual_grid.iteration
    return (
        (of_cameras,) if iteration is None else (of_cameras, residual_correlation.iteration_table(iteration))
    )


def _field_plots(field: ResidualField) -> dict[str, Markup]:
    """Mean residuals of a camera, and what was added to its image coordinates."""
    plots = {"mean": residual_field.field_plot(field, field.mean, "Mean residuals")}
    if field.correction is not None:
        plots["correction"] = residual_field.field_plot(field, field.correction, "Corrections")
    return plots


def _plots(material: Material, found: Sequence[causes.Cause]) -> list[Plot]:
    """The plots for which there is something to show."""
    made = {
        "block": block_map.block_map(material, found),
        "orientations": orientation_precision.orientation_plot(material),
        "heights": point_precision.height_precision_map(material) if len(material.object_points) else None,
        "histogram": histogram.histogram_plot(material) if len(material.standardized[IMAGE_POINTS]) else None,
        "residual-correlation": residual_correlation.correlation_plot(material),
        "correlations": correlations.correlation_plot(material),
        "datum": datum.datum_plot(material),
        "trajectory": trajectories.trajectory_map(material.trajectories, material.exposures),
        "trust-map": trust_map.trust_map_plot(material),
        "trust-histogram": trust_map.trust_map_histogram(material),
        "strip-differences": strip_differences.strip_plot(material.strip_means),
    }
    return [Plot(name, drawing) for name, drawing in made.items() if drawing is not None]
