"""The page of a sweep: ``sweep.html``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.report.provenance import SOFTWARE, versions_table
from tasks.documents.sweep.page import render
from tasks.settings.published_sweep import PublishedTable
from tasks.store.artifact import Artifact
from tasks.store.store import stored
from tasks.sweep.result_tables import (
    SweepResults,
)
from tasks.sweep.scenario import Computed
from tasks.tables.parquet import read_table

PAGE = "sweep.html"


@stored("sweep_page")
def write_sweep_page(
    folder: Path,
    *,
    table: Artifact,
    computed: tuple[Computed, ...],
    published: PublishedTable | None,
    name: str,
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write sweep.html.

    Parameters
    ----------
    table : sweep.parquet.
    computed : every scenario and its outcome, for the maps of the image.
    published : the table shown next to it.
    name : of the project.
    software : versions that decide how the page looks.
    """
    ordered = read_table(table).sort_values("number", ignore_index=True)
    page = render(SweepResults(ordered, published), computed, name, versions_table(software))
    (folder / PAGE).write_text(page, encoding="utf-8")
