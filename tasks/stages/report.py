"""The report as a stage: ``report.html``, one self-contained page, and its map as a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.report.provenance import SOFTWARE
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.store import stored

REPORT = "report.html"
#: The map of the block.
MAP = "map.svg"


@stored("report")
def write_report(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    project: Project,
    name: str,
    files: tuple[str, ...],
    flown: str = "",
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write report.html and map.svg.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    project : the settings, which the report shows; its gates are tested.
    name : the project's name (it is not part of the settings' content).
    files : names of the delivered files, without folders.
    flown : date of the flight (not part of that content either); empty: unknown.
    software : versions that decide how the report looks.
    """
    # A run that finds the report stored never loads what writes it.
    from tasks.documents.report.export import figure_of
    from tasks.documents.report.material import read_material
    from tasks.documents.report.page import render

    page = render(read_material(stages, project), name, files, software, flown)
    (folder / REPORT).write_text(page, encoding="utf-8")
    (folder / MAP).write_text(figure_of(page, "block"), encoding="utf-8")
