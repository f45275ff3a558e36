"""Carry out ``aerocal sweep`` and show the scenarios as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from rich.table import Table
from rich.text import Text

from flows.command.execution import ended, outcome_of
from flows.command.result_table import where_results_are
from flows.command.screen_table import print_listed, screen, screen_table
from flows.runs.project_run import RunOutcome, RunRequest, Story
from flows.runs.workers import use_cluster
from tasks.files.json_text import JSON


def execute_sweep(
    project_file: Path,
    out: str | None,
    overrides: tuple[str, ...],
    data: Path | None,
    server: str | None,
    dask: str | None,
    *,
    as_json: bool,
) -> int:
    """Run the sweep of a project and show the result; returns the exit code."""
    use_cluster(dask)
    request = RunRequest.of(project_file, out, overrides, data)

    def story() -> Story:
        from flows.stories.scenario_sweep import sweep_of

        return sweep_of(request)

    return ended(outcome_of(request, "scenario_sweep", story, server), _show, as_json=as_json)


def _show(outcome: RunOutcome) -> None:
    """Problems, a line for each scenario, and where the results are."""
    console = screen()
    print_listed(console, outcome.summary.problems, "yellow")
    rows = cast(Sequence[Mapping[str, JSON]], (outcome.summary.model_extra or {})["sweep"])
    console.print(_table(rows))
    console.print(Text(f"\nPage: {outcome.directory / 'sweep.html'}"), soft_wrap=True)
    for sentence in where_results_are(outcome, "sweep.parquet and summary.json"):
        console.print(Text(sentence), soft_wrap=True)


def _table(rows: Sequence[Mapping[str, JSON]]) -> Table:
    numbers = ("σ0 µm", "/ first", "RMS X", "Y", "Z m")
    table = screen_table("block", "control", "variant", *numbers, "at the", right=numbers, whole=("at the",))
    for row in rows:
        names = [str(row[name]) for name in ("block", "control", "variant")]
        if row["status"] != "done":
            table.add_row(*names, *["–"] * 5, str(row["status"]).replace("_", " "))
            continue
        role = "check" if row["rmse_check_m"] is not None else "control"
        differences = cast(Sequence[JSON], row[f"rmse_{role}_m"] or (None, None, None))
        figures = [_number(row["sigma0_um"]), _number(row["sigma0_ratio"]), *map(_number, differences)]
        table.add_row(*names, *figures, f"{role} points")
    return table


def _number(value: JSON) -> str:
    return f"{value:.3f}" if isinstance(value, float) else "–"
