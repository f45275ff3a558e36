"""Carry out ``aerocal doctor`` and show what it found."""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.text import Text

from flows.command.examination_table import examination_tables
from flows.command.exit_code import DONE
from flows.command.progress import show_progress
from flows.runs.project_run import RunRequest
from flows.stories.examination import Examination, ListedMistake, examine_everything
from tasks.files.json_text import JSON, json_text
from tasks.store.run_lock import run_lock
from tasks.store.store import Store


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
    for table in examination_tables({finding.subject: finding.figures for finding in found.findings}):
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
