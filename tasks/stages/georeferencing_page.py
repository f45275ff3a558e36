"""The page of a direct-georeferencing check: ``georeferencing_check.html``, and its map as a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.georeferencing.material import read_check
from tasks.documents.georeferencing.page import render
from tasks.documents.report.export import figure_of
from tasks.documents.report.provenance import SOFTWARE
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.store import stored

PAGE = "georeferencing_check.html"
#: The map of the differences; only where there are surveyed points.
MAP = "georeferencing_map.svg"


@stored("georeferencing_page")
def write_georeferencing_page(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    project: Project,
    name: str,
    files: tuple[str, ...],
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write georeferencing_check.html, and georeferencing_map.svg if there is anything to show.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    project : the settings, which the page shows; its gates are tested.
    name : the project's name (it is not part of the settings' content).
    files : names of the delivered files, without folders.
    software : versions that decide how the page looks.
    """
    material = read_check(stages, project)
    page = render(material, name, files, software)
    (folder / PAGE).write_text(page, encoding="utf-8")
    if len(material.points):
        (folder / MAP).write_text(figure_of(page, "differences"), encoding="utf-8")
