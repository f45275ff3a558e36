"""Carry out ``aerocal batch`` and show the projects as a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from rich.text import Text

from flows.command.exit_code import DEFECT, DONE, OF_STATUS
from flows.command.progress import show_progress
from flows.command.screen_table import figure, screen, screen_table
from flows.runs.batch import ProjectEnd, carry_out_batch
from flows.runs.project_run import RunRequest, StoryName
from flows.runs.workers import use_cluster
from tasks.errors import InputError
from tasks.files.delivered_file import is_there
from tasks.files.json_text import JSON, finite, json_text

_STYLES = {DONE: "green"}
_PROJECT_FILE = "project.toml"


def execute_batch(
    projects: Sequence[Path],
    story: str | None,
    output: str,
    overrides: tuple[str, ...],
    data: Path | None,
    workers: int | None,
    dask: str | None,
    *,
    as_json: bool,
) -> int:
    """Run the projects and show their outcome; returns the exit code of the worst."""
    if Path(output).name != output or output in ("", ".."):
        raise InputError(
            f"'{output}' is not the name of a folder.", "Give a name without '/'.", entity="--output"
        )
    use_cluster(dask)
    show_progress()
    requests = [_request(project, output, overrides, data) for project in projects]
    chosen = None if story is None else cast(StoryName, story.replace("-", "_"))
    ends = carry_out_batch(requests, chosen, workers)
    if as_json:
        print(json_text([_as_json(end) for end in ends], indent=2))
    else:
        _show(ends)
    return worst(ends)


def _request(project: Path, output: str, overrides: tuple[str, ...], data: Path | None) -> RunRequest:
    file = (project / _PROJECT_FILE if is_there(project) and project.is_dir() else project).absolute()
    # Beside a file that is not there nothing is to be made.
    out = file.parent / output if is_there(file) else None
    return RunRequest(file, out, overrides, None if data is None else data.absolute())


def exit_code(end: ProjectEnd) -> int:
    """The exit code this project would have ended with alone."""
    return DEFECT if end.summary is None else OF_STATUS[end.summary.status]


def worst(ends: Sequence[ProjectEnd]) -> int:
    """The exit code of a batch: the smallest that is not 0."""
    return min((code for end in ends if (code := exit_code(end)) != DONE), default=DONE)


def _as_json(end: ProjectEnd) -> JSON:
    summary = end.summary
    return {
        "project": str(end.request.project_file),
        "directory": str(end.request.directory),
        "status": "failed" if summary is None else summary.status,
        "exit_code": exit_code(end),
        "sigma0": None if summary is None else finite(summary.sigma0),
        "rmse_check_m": None if summary is None else finite(summary.rmse_check_m),
        "gates_failed": [] if summary is None else [gate.name for gate in summary.gates if not gate.passed],
        "error": end.error,
    }


def _show(ends: Sequence[ProjectEnd]) -> None:
    """One line for each project; below, why some have no result."""
    console = screen()
    numbers = ("σ0", "RMS check X", "Y", "Z m")
    table = screen_table("project", "state", *numbers, "gates failed", right=numbers)
    for end in ends:
        table.add_row(*_row(end))
    console.print(table)
    for end in ends:
        if end.error is not None:
            console.print(Text(f"\n{_name(end)}: {end.error}", style="red"), soft_wrap=True)


def _row(end: ProjectEnd) -> tuple[str | Text, ...]:
    summary = end.summary
    state = "failed" if summary is None else summary.status.replace("_", " ")
    shown = Text(state, style=_STYLES.get(exit_code(end), "bold red"))
    if summary is None:
        return (_name(end), shown, *["–"] * 4, "")
    differences = summary.rmse_check_m or (None, None, None)
    failed = ", ".join(gate.name for gate in summary.gates if not gate.passed)
    return (_name(end), shown, *(figure(value, 3) for value in (summary.sigma0, *differences)), failed)


def _name(end: ProjectEnd) -> str:
    file = end.request.project_file
    return file.parent.name if file.name == _PROJECT_FILE else f"{file.parent.name}/{file.name}"
