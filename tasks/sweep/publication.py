"""Publish a sweep: its table and its page, and a summary with a line for each scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import pandas as pd

from tasks.errors import NotComputableError
from tasks.files.json_text import JSON, finite
from tasks.results.publish import OF_EVERY_SWEEP, put_out
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.store.stage_record import read_records, timings_s
from tasks.store.store import Store
from tasks.sweep.scenario import Computed
from tasks.tables.parquet import read_table

_TEXTS = ("block", "control", "variant", "status", "reason")
_NUMBERS = ("sigma0", "sigma0_um", "sigma0_ratio")
_TRIPLES = ("rmse_control", "max_control", "rmse_check", "max_check")


def publish_sweep(
    store: Store,
    project: Project,
    computed: Sequence[Computed],
    table: Mapping[str, Artifact],
    page: Mapping[str, Artifact],
) -> Summary:
    """Put sweep.parquet and sweep.html into the output folder.

    Parameters
    ----------
    computed : every scenario and what became of it.
    table, page : outputs of the stages that wrote them.

    Raises
    ------
    NotComputableError
        If no scenario has a result.
    """
    reasons = read_notes(table["notes"]).problems
    if len(reasons) == len(computed):
        raise NotComputableError(f"None of the {len(computed)} scenarios could be computed. {reasons[0]}")
    records = read_records(store.folder)
    seconds = {record.key: record.seconds for record in records}
    rows = _rows(read_table(table["sweep"]), computed, seconds)
    summary = Summary.model_validate(
        {"status": "done", "timings_s": timings_s(records), "problems": reasons, "sweep": rows}
    )
    put_out(store, project, [table["sweep"], page["sweep"]], summary, OF_EVERY_SWEEP)
    return summary


def _rows(table: pd.DataFrame, computed: Sequence[Computed], seconds: Mapping[str, float]) -> list[JSON]:
    """A line for each scenario: names, status, figures, and the seconds its adjustment took in this run."""
    rows: list[JSON] = []
    for (_, row), one in zip(table.sort_values("number").iterrows(), computed, strict=True):
        line: dict[str, JSON] = {name: row[name] if isinstance(row[name], str) else None for name in _TEXTS}
        line |= {name: float(row[name]) for name in _NUMBERS}
        for name in _TRIPLES:
            values = [float(row[f"{name}_{axis}_m"]) for axis in "xyz"]
            line[f"{name}_m"] = cast(JSON, values) if any(value == value for value in values) else None
        adjusted = one.artifacts.get("exterior_orientations")
        line["seconds"] = None if adjusted is None else seconds.get(adjusted.path.parent.name)
        rows.append(finite(line))
    return rows
