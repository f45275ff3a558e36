"""The report of a two-step calibration by itself: ``report.html``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.report.provenance import SOFTWARE
from tasks.documents.report.two_step_page import render
from tasks.results.summary import summary_of
from tasks.settings.project import Project
from tasks.stages.report import REPORT
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table


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
