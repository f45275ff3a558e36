"""What the figures and tables of an adjustment mean, in sentences.

A separate stage, so that new or reworded sentences do not repeat the adjustment.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from tasks.files.json_text import JSON
from tasks.remarks.adjustment import (
    free_network_sentences,
    given_ground,
    global_test_sentences,
    group_sentences,
    late_head_sentences,
    registered_calibration_sentences,
    rejection_sentences,
    self_calibration_sentences,
    shared_moment_sentences,
    trust_map_sentences,
    without_effect_sentences,
)
from tasks.remarks.independent_checks import check_point_sentences, distance_sentences
from tasks.remarks.model_findings import model_findings, strip_scatter_sentences
from tasks.remarks.observation_sigmas import (
    correlation_time_sentences,
    unestimated_sentences,
    variance_sentences,
)
from tasks.remarks.residual_grid import residual_grid_sentences, stopped_because
from tasks.remarks.separability import weak_parameter_sentences
from tasks.results.figures import AdjustmentFigures, ModelFinding, figures_of
from tasks.results.summary import Summary, summary_of_figures
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.tables.parquet import read_table


def write_remarks(
    folder: Path,
    notes: Artifact,
    model_alternatives: Artifact,
    distance_residuals: Artifact,
    residual_autocorrelation: Artifact,
    *,
    calibrating: bool,
) -> None:
    """Write the remarks on an adjustment; see `tasks.stages.remarks_stage`."""
    written = read_notes(notes).figures
    figures, summary = figures_of(written), summary_of_figures(written)
    rejecting = figures.critical_value is not None
    findings = model_findings(read_table(model_alternatives), rejecting=rejecting)
    distances, neighbours = read_table(distance_residuals), read_table(residual_autocorrelation)
    said = (
        *_of_tests(figures, summary, distances, findings),
        *_of_adjustment(figures, summary, calibrating),
        *residual_grid_sentences(figures.residual_grid, neighbours),
        *(trust_map_sentences(figures.trust_map_grid) if "trust_map_grid" in written else ()),
    )
    own: dict[str, JSON] = {"model_findings": [item.to_json() for item in findings]}
    iteration = figures.residual_grid.iteration
    if iteration is not None:
        own["residual_grid"] = {"iteration": {"stopped_because": stopped_because(iteration)}}
    write_notes(folder, Notes(said, own))


def _of_tests(
    figures: AdjustmentFigures,
    summary: Summary,
    distances: pd.DataFrame,
    findings: tuple[ModelFinding, ...],
) -> Iterator[str]:
    """What contradicts the block: calibrations, check points and distances, alternatives of its model."""
    yield from registered_calibration_sentences(figures)
    yield from check_point_sentences(summary.check_point_test, given_ground(figures))
    if summary.distances is not None:
        yield from distance_sentences(distances, summary.distances.confidence)
    yield from (item.sentence for item in findings)
    if not findings:  # which may be what varies
        yield from strip_scatter_sentences(figures.strip_scatter)


def _of_adjustment(figures: AdjustmentFigures, summary: Summary, calibrating: bool) -> Iterator[str]:
    """What the user should know about the result, most serious first."""
    yield from free_network_sentences(figures.free_network)
    yield from global_test_sentences(figures, summary.sigma0 or 0.0, summary.redundancy or 0.0)
    yield from group_sentences(figures)
    yield from variance_sentences(figures.variance_components)
    yield from correlation_time_sentences(figures.correlation_times)
    if not calibrating:
        yield from weak_parameter_sentences(figures.weak_parameters)
    yield from rejection_sentences(figures)
    yield from shared_moment_sentences(figures.shared_moments)
    yield from late_head_sentences(figures.late_heads)
    yield from self_calibration_sentences(figures)
    yield from unestimated_sentences(figures.variance_components, figures.correlation_times)
    yield from without_effect_sentences(figures.without_effect)
