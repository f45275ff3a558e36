"""Carry out ``aerocal doctor`` and show what it found."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.progress import show_progress
from flows.runs.project_run import RunRequest
from flows.stories.examination import Examination, ListedMistake, examine_everything
from tasks.files.json_text import JSON, json_text
from tasks.store.run_lock import run_lock
from tasks.store.store import Store

# Lines of one list; a block may have hundreds of control points.
_MOST = 5


def examine(
    project_file: Path, out: str | None, overrides: tuple[str, ...], data: Path | None, *, as_json: bool
) -> int:
    """Examine a project and print the findings; wrong input raises InputError."""
    show_progress()
    request = RunRequest.of(project_file, out, overrides, data)
    project = request.project()
    with tempfile.TemporaryDirectory(prefix="aerocal-doctor-") as temporary:
        # Without --out nothing is written next to the project.
        store = request.store() if out is not None else Store.of(Path(temporary))
        with run_lock(store.folder.parent):
            store.begin_run()
            found = examine_everything(project, store)
    if as_json:
        print(json_text(_as_json(found), indent=2))
    else:
        _show(found)
    if found.refusal is not None:
        raise found.refusal
    return DONE


def _as_json(found: Examination) -> JSON:
    stages: dict[str, JSON] = {
        finding.subject: {"figures": finding.figures, "problems": finding.problems}
        for finding in found.findings
    }
    return {**stages, "mistakes": [cast(JSON, asdict(mistake)) for mistake in found.mistakes]}


def _show(found: Examination) -> None:
    console = Console()
    listed = {mistake.what for mistake in found.mistakes}
    problems = [one for finding in found.findings for one in finding.problems if one not in listed]
    if found.refusal is None:
        clean = ": nothing looks wrong" if not (problems or found.mistakes) else ""
        console.print(Text(f"\nThe project can be read{clean}.", style="bold"))
    if found.mistakes:
        count = len(found.mistakes)
        console.print(Text(f"\n{count} possible mistake{'s' if count > 1 else ''}:", style="bold"))
    for number, mistake in enumerate(found.mistakes, start=1):
        _show_mistake(console, number, mistake)
    if problems:
        console.print(Text("\nRemarks:", style="bold"))
    for sentence in problems:
        console.print(Text(f"• {sentence}", style="yellow"))
    for finding in found.findings:
        table = Table(
            title=finding.subject, title_justify="left", title_style="bold", show_header=False, box=None
        )
        for name, value in _rows(finding.figures):
            table.add_row(name, value)
        if table.row_count:
            console.print(table)


def _show_mistake(console: Console, number: int, mistake: ListedMistake) -> None:
    """What, the evidence under each hypothesis, the remedy and its line in the project file."""
    console.print(Text(f"{number}. {mistake.what}", style="yellow"))
    for line in mistake.evidence:
        console.print(Text(f"     {line}"))
    if mistake.remedy:
        console.print(Text(f"   → {mistake.remedy}"))
    if mistake.declare:
        console.print(Text(f"     {mistake.declare}", style="bold"), soft_wrap=True)


def _rows(figures: Mapping[str, JSON], above: str = "") -> list[tuple[str, str]]:
    """Figures as rows of text; the name of a nested figure starts with that of its table."""
    rows: list[tuple[str, str]] = []
    for name, value in figures.items():
        label = f"{above}{name.replace('_', ' ')}"
        if isinstance(value, Mapping):
            rows += _rows(value, f"{label}: ")
        elif isinstance(value, Sequence) and any(isinstance(item, Mapping) for item in value):
            rows += _largest(label, [item for item in value if isinstance(item, Mapping)])
        else:
            rows.append((label, _text(value)))
    return rows


def _largest(label: str, items: Sequence[Mapping[str, JSON]]) -> list[tuple[str, str]]:
    """One line for each table of figures in a list: only the few with the largest values, largest first."""

    def size(item: Mapping[str, JSON]) -> float:
        return max((abs(value) for value in item.values() if isinstance(value, float)), default=0.0)

    rows = [(label, _in_one_line(item)) for item in sorted(items, key=size, reverse=True)[:_MOST]]
    more = len(items) - len(rows)
    return [*rows, (label, f"and {more:,} more, with smaller values (--json has all)")] if more else rows


def _in_one_line(item: Mapping[str, JSON]) -> str:
    """The name followed by its figures: ``C108: dx m -0.238, dy m 0.155``."""
    named = ", ".join(value for value in item.values() if isinstance(value, str))
    numbers = [
        f"{name.replace('_', ' ')} {_text(value)}"
        for name, value in item.items()
        if not isinstance(value, str)
    ]
    return f"{named}: {', '.join(numbers)}" if named else ", ".join(numbers)


def _text(value: JSON) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:,.4g}" if abs(value) < 1e4 else f"{value:,.1f}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(_text(item) for item in value)
    return str(value)
