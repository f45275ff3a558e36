"""The material of the page of a check, its tables and figures, and the verdict in one sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from tasks.documents.georeferencing.check_figures import CheckFigures
from tasks.documents.report.figures import gate_words
from tasks.documents.report.key_figures import Verdict
from tasks.results.summary import Summary, summary_of
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table


@dataclass(frozen=True, eq=False)
class CheckMaterial:
    """The tables of one check, and its figures.

    Attributes
    ----------
    project : the settings of the run.
    summary : what summary.json says, without timings.
    figures : those of the check.
    images, exposures, points, parallaxes, models : images, exposures, direct_georeferencing, y_parallaxes and
        stereo_models.parquet.
    """

    project: Project
    summary: Summary
    figures: CheckFigures
    images: pd.DataFrame
    exposures: pd.DataFrame
    points: pd.DataFrame
    parallaxes: pd.DataFrame
    models: pd.DataFrame


def read_check(stages: Sequence[Mapping[str, Artifact]], project: Project) -> CheckMaterial:
    """Read everything the page shows.

    Parameters
    ----------
    stages : the outputs of all stages by name, in the order in which they ran.
    """
    tables = {name: artifact for outputs in stages for name, artifact in outputs.items()}
    notes = [read_notes(outputs["notes"]) for outputs in stages if "notes" in outputs]
    summary = summary_of(notes, project.gates, {})
    direct = summary.direct_georeferencing
    return CheckMaterial(
        project,
        summary,
        CheckFigures.model_validate({} if direct is None else direct.model_dump()),
        read_table(tables["images"]),
        read_table(tables["exposures"]),
        read_table(tables["direct_georeferencing"]),
        read_table(tables["y_parallaxes"]),
        read_table(tables["stereo_models"]),
    )


def verdict(material: CheckMaterial) -> Verdict:
    """The result at independent points, whether it was expected, and the limits."""
    found, expected = _differences(material)
    gates = material.summary.gates
    failed = [gate_words(gate.name) for gate in gates if not gate.passed]
    if failed:
        return Verdict("failed", f"{found} Not met: {'; '.join(failed)}.")
    kept = "All limits are met." if gates else "No limits are set in the project."
    return Verdict("good" if expected else "attention", f"{found} {kept}")


def _differences(material: CheckMaterial) -> tuple[str, bool]:
    """The differences in words, and whether they agree with the prediction."""
    figures = material.figures
    if figures.count == 0:
        return "Direct georeferencing was not tested: there are no independent check points.", False
    rmse = ", ".join(f"{value:.3f}" if value is not None else "–" for value in figures.rmse_m)
    words = (
        f"With direct georeferencing, {figures.count} independent check points differ from their survey by "
        f"{rmse} m (RMS east, north, up)"
    )
    too_large = [
        rms is not None and high is not None and rms > high
        for rms, high in zip(figures.rmse_m, figures.predicted_high_m, strict=True)
    ]
    if any(too_large):
        return f"{words}, more than expected from the stated σ.", False
    return f"{words}, as expected from the stated σ.", True
