"""report.html of a two-step calibration by itself: delivered orientations against GNSS/INS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from tasks.coordinates.crs import MapFrame
from tasks.figures import figures_of
from tasks.report.key_figures import Verdict, gate_table
from tasks.report.page import environment
from tasks.report.provenance import SOFTWARE, files_table, settings_table, versions_table
from tasks.report.stage import REPORT
from tasks.report.strip_differences import strip_plot
from tasks.report.two_step import parameter_table, two_step_tables
from tasks.settings.project import Project
from tasks.storage.artifact import Artifact
from tasks.storage.notes import read_notes
from tasks.storage.store import stored
from tasks.summary import Summary, summary_of
from tasks.tables.parquet import read_table

_TONES = {"accepted": "good", "restricted": "attention", "refused": "failed"}
_WORDS = {
    "accepted": "The two-step calibration is accepted.",
    "restricted": "The two-step calibration is accepted with restrictions.",
    "refused": "The two-step calibration is refused.",
}


@stored("report")
def write_two_step_report(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    project: Project,
    name: str,
    files: tuple[str, ...],
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write report.html.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    project : the settings, which the page shows; its gates are tested.
    name : the project's name (it is not part of the settings' content).
    files : names of the delivered files, without folders.
    software : versions that decide how the page looks.
    """
    outputs = {label: artifact for one in stages for label, artifact in one.items()}
    summary = summary_of([read_notes(one["notes"]) for one in stages], project.gates, {})
    means = read_table(outputs["orientation_difference_means"])
    page = render(summary, means, project, name, files, software)
    (folder / REPORT).write_text(page, encoding="utf-8")


def render(
    summary: Summary,
    means: pd.DataFrame,
    project: Project,
    name: str,
    files: tuple[str, ...],
    software: Mapping[str, str],
) -> str:
    """The page as text."""
    figures = figures_of(summary.model_extra)
    found = figures.two_step_calibration
    if found is None:
        raise ValueError("the run has no two-step calibration")
    tables = (
        parameter_table(found.parameters),
        *two_step_tables(figures.two_step),
        gate_table(summary.gates),
        settings_table(project),
        files_table(project, files),
        versions_table(software),
    )
    plot = strip_plot(means)
    page: str = (
        environment()
        .get_template("two_step_page.html.j2")
        .render(
            name=name,
            frame=MapFrame.of(project.project.crs, project.project.heights).description,
            verdict=Verdict(_TONES[found.verdict], _WORDS[found.verdict]),  # type: ignore[arg-type]
            problems=summary.problems,
            found=found,
            figures=figures,
            tables={table.name: table for table in tables},
            plots={} if plot is None else {"strip-differences": plot},
        )
    )
    return page
