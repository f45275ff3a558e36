"""report.html of a two-step calibration by itself: delivered orientations against GNSS/INS."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from tasks.coordinates.crs import MapFrame
from tasks.document_kit.templates import rendered
from tasks.documents.report.key_figures import Verdict, gate_table
from tasks.documents.report.page import TEMPLATES
from tasks.documents.report.provenance import files_table, settings_table, versions_table
from tasks.documents.report.strip_differences import strip_plot
from tasks.documents.report.two_step import parameter_table, two_step_tables
from tasks.results.figures import figures_of
from tasks.results.summary import Summary
from tasks.settings.project import Project

_TONES = {"accepted": "good", "restricted": "attention", "refused": "failed"}
_WORDS = {
    "accepted": "The two-step calibration is accepted.",
    "restricted": "The two-step calibration is accepted with restrictions.",
    "refused": "The two-step calibration is refused.",
}


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
        raise ValueError("the run contains no two-step calibration")
    tables = (
        parameter_table(found.parameters),
        *two_step_tables(figures.two_step),
        gate_table(summary.gates),
        settings_table(project),
        files_table(project, files),
        versions_table(software),
    )
    plot = strip_plot(means)
    return rendered(
        "two_step_page.html.j2",
        TEMPLATES,
        name=name,
        frame=MapFrame.of(project.project.crs, project.project.heights).description,
        verdict=Verdict(_TONES[found.verdict], _WORDS[found.verdict]),  # type: ignore[arg-type]
        problems=summary.problems,
        found=found,
        figures=figures,
        tables={table.name: table for table in tables},
        plots={} if plot is None else {"strip-differences": plot},
    )
