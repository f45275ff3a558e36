"""Carry out ``aerocal sweep`` and show the scenarios as a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from flows.command.execution import ended, outcome_of
from flows.command.result_table import where_results_are
from flows.command.screen_table import print_listed, screen, screen_table
from flows.runs.project_run import RunOutcome, RunRequest, Story
from flows.runs.workers import use_cluster
from tasks.files.json_text import JSON

# Columns of a screen that no table needs.
_UNLIMITED = 100_000


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
    console.print(scenario_table(rows, console))
    console.print(Text(f"\nPage: {outcome.directory / 'sweep.html'}"), soft_wrap=True)
    for sentence in where_results_are(outcome, "sweep.parquet and summary.json"):
        console.print(Text(sentence), soft_wrap=True)


def scenario_table(rows: Sequence[Mapping[str, JSON]], console: Console) -> Table:
    """A line for each scenario; its names share a column, wrapped between them, where three are too wide."""
    table = _with_names(rows, lambda names: names, ("block", "control", "variant"))
    unlimited = console.options.update(width=_UNLIMITED)
    if Measurement.get(console, unlimited, table).maximum <= console.width:
        return table
    return _with_names(rows, lambda names: [" · ".join(names)], ("block · control · variant",))


def _with_names(
    rows: Sequence[Mapping[str, JSON]], shown: Callable[[list[str]], list[str]], headings: tuple[str, ...]
) -> Table:
    numbers = ("σ0 µm", "/ first", "RMS X", "Y", "Z m")
    table = screen_table(*headings, *numbers, "points", right=numbers, whole=("points",))
    for row in rows:
        names = shown([str(row[name]) for name in ("block", "control", "variant")])
        if row["status"] != "done":
            table.add_row(*names, *["–"] * 5, str(row["status"]).replace("_", " "))
            continue
        role = "check" if row["rmse_check_m"] is not None else "control"
        differences = cast(Sequence[JSON], row[f"rmse_{role}_m"] or (None, None, None))
        figures = [_number(row["sigma0_um"]), _number(row["sigma0_ratio"]), *map(_number, differences)]
        table.add_row(*names, *figures, role)
    return table


def _number(value: JSON) -> str:
    return f"{value:.3f}" if isinstance(value, float) else "–"
