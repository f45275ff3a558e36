"""Section of the image: effect of the additional parameters, and the remaining systematic residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from markupsafe import Markup

from tasks.document_kit import axes
from tasks.document_kit.format_plot import FormatPlot
from tasks.documents.certificate.content import Block, Figure, Listing, Section, Words, beside
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report import image_errors, image_errors_plot, residual_field
from tasks.documents.report.material import Material
from tasks.documents.report.residual_field import ResidualField

#: Where the drawings over the format have room for it: left, top, width, height.
_ROOM = (70.0, 24.0, axes.WIDTH - 82.0, 640.0)
_LEAST_WIDTH = 470.0
# Drawings narrower than this stand side by side.
_NARROW = 0.62


def effect_section(material: CertificateMaterial) -> Section:
    """Maps over the image format, of the certified cameras only."""
    results, names = material.results, material.record.names
    before, effects = _effects(results, names)
    after, residuals = _residuals(results, names)
    figures = [*effects, *residuals]
    blocks: list[Block] = [*before, *after]
    if len(figures) > 1 and all(figure.width < _NARROW for figure in figures):
        for first in range(0, len(figures), 2):
            blocks += beside(*figures[first : first + 2])
    else:
        blocks += figures
    return Section("image", "Systematic image errors and residuals", tuple(blocks))


def _effects(results: Material, names: Sequence[str]) -> tuple[list[Block], list[Figure]]:
    """Table and map of the effect of the additional parameters."""
    errors = tuple(own for own in image_errors.image_errors(results) if own.camera.name in names)
    acting = tuple(own for own in errors if own.all.longest_um > 0.0)
    if not acting:
        offered = " All candidates were eliminated." if errors else ""
        return [Words(f"No additional parameters are applied to the image.{offered}")], []
    figures = []
    for index, own in enumerate(acting, start=1):
        name_of_figure = "image-errors" if len(acting) == 1 else f"image-errors-{index}"
        caption = (
            f"Effect of the additional parameters of {own.entity}: the systematic image error −Δ, the error "
            "of a measured coordinate."
        )
        words = f"Systematic image errors of {own.entity}, root mean square {own.all.rms_um:.2f} µm"
        figure = Figure(name_of_figure, caption, words, image_errors_plot.errors_plot(own))
        figures.append(cut_to_format(figure, own.camera.half_format))
    return [Listing(image_errors.errors_table(acting))], figures


def _residuals(results: Material, names: Sequence[str]) -> tuple[list[Block], list[Figure]]:
    """Table and maps of the mean residuals, and of what was added to the image coordinates."""
    confidence = results.project.adjustment.confidence
    fields = tuple(f for f in residual_field.residual_fields(results) if f.camera.name in names)
    figures: list[Figure] = []
    for field in fields:
        number = "" if len(fields) == 1 else f"-{len(figures) + 1}"
        figures.append(_residual_map(field, confidence, number))
        if field.correction is not None:
            figure = Figure(
                f"residual-corrections{number}",
                "Added to the image coordinates before the adjustment: the mean residuals of an earlier "
                "adjustment. They are not parameters of the record, but its users need them.",
                f"Corrections of the image coordinates of camera {field.camera.name}",
                residual_field.field_plot(field, field.correction, "Corrections"),
            )
            figures.append(cut_to_format(figure, field.camera.half_format))
    if not fields:
        return [Words("No sub-area of the image has enough residuals to compute a mean.")], []
    return [Listing(residual_field.field_table(fields, confidence))], figures


def _residual_map(field: ResidualField, confidence: float, number: str) -> Figure:
    of_head = f" of {field.camera.name}" if number else ""
    caption = (
        f"Mean residuals{of_head} (adjusted − observed) in sub-areas of the image, after the correction by "
        f"all parameters. Dark: significantly different from zero at {100 * confidence:g} %; the table gives "
        "the number expected by chance."
    )
    figure = Figure(
        f"mean-residuals{number}",
        caption,
        f"Mean residuals of camera {field.camera.name} in sub-areas of the image",
        residual_field.field_plot(field, field.mean, "Mean residuals"),
    )
    return cut_to_format(figure, field.camera.half_format)


def cut_to_format(figure: Figure, half_format: tuple[float, float]) -> Figure:
    """The figure without the empty ground to the right of a format that is taller than wide."""
    plot = FormatPlot.within(half_format, *_ROOM)
    # The legend under the format needs some room of its own.
    right = round(min(max(plot.x.end + 30.0, _LEAST_WIDTH), axes.WIDTH))
    whole, cut = f'viewBox="0 0 {axes.WIDTH:g} ', f'viewBox="0 0 {right:g} '
    drawing = Markup(str(figure.drawing).replace(whole, cut, 1))
    return replace(figure, drawing=drawing, width=right / axes.WIDTH)
