"""Carry out ``aerocal doctor`` and show what it read, how well orientations fit, and what it found."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import cast

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.progress import show_progress
from flows.command.screen_table import print_listed, screen
from flows.runs.project_run import RunRequest
from flows.stories.examination import Examination, ListedMistake, examine_everything
from tasks.files.delivered_file import require_folder
from tasks.files.json_text import JSON, json_text
from tasks.store.run_lock import run_lock
from tasks.store.store import Store

# Control points shown; a block may have hundreds.
_MOST = 5
#: Figures of the imports in their order on the screen: stage, name of the figure, words.
_COUNTS = (
    ("exposures and cameras", "exposures", "exposures"),
    ("image points", "exposures_without_image_points", "  without image points"),
    ("control", "control", "control points"),
    ("control", "check", "check points"),
    ("image points", "image_points_read", "image points read"),
    ("image points", "outside_format", "  outside the image format"),
    ("image points", "image_points", "  used"),
    ("image points", "object_points", "object points"),
    ("image points", "single_ray_points", "  ignored, measured in one image only"),
)
_RESIDUALS = (
    ("tie_rms_px", "tie points, intersected"),
    ("control_reprojection_rms_px", "control points, as surveyed"),
)


def examination_tables(figures: Mapping[str, Mapping[str, JSON]]) -> list[RenderableType]:
    """Tables of the figures (subject → figures) that the stages of an examination found."""
    fit = cast(Mapping[str, JSON], figures.get("approximate values", {}).get("given_orientations", {}))
    control = cast(Sequence[Mapping[str, JSON]], fit.get("control", ()))
    tables = {
        "The delivery": _read(figures),
        "Image residuals with the given orientations": _residuals(fit),
        "Control points: intersected with the given orientations, less surveyed": _differences(control),
    }
    return [
        part
        for title, table in tables.items()
        if table.row_count
        for part in (Text(f"\n{title}", style="bold"), table)
    ]


def _read(figures: Mapping[str, Mapping[str, JSON]]) -> Table:
    table = _columns()
    table.show_header = False
    table.add_column()
    table.add_column(justify="right")
    for subject, name, words in _COUNTS:
        count = cast(Mapping[str, int], figures.get(subject, {}).get("counts", {})).get(name)
        if count is not None:
            table.add_row(words, f"{count:,}")
    return table


def _residuals(fit: Mapping[str, JSON]) -> Table:
    table = _columns("RMS, px", "column", "row")
    for name, words in _RESIDUALS:
        rms = cast(Sequence[float] | None, fit.get(name))
        if rms is not None:
            table.add_row(words, *(f"{value:.3f}" for value in rms))
    return table


def _differences(control: Sequence[Mapping[str, JSON]]) -> Table:
    """The control points with the largest differences, largest first."""
    by_size = sorted(control, key=lambda point: -max(abs(value or 0.0) for value in _difference(point)))
    table = _columns("point", "rays", "east, m", "north, m", "height, m")
    for point in by_size[:_MOST]:
        table.add_row(
            str(point["point"]),
            str(point["rays"]),
            *("–" if value is None else f"{value:+z.3f}" for value in _difference(point)),
        )
    if len(control) > _MOST:
        table.caption = f"and {len(control) - _MOST:,} more, with smaller differences (--json has all)"
        table.caption_justify = "left"
    return table


def _difference(point: Mapping[str, JSON]) -> tuple[float | None, ...]:
    """(east, north, height), metres; None where the point was not surveyed."""
    return tuple(cast(float | None, point[name]) for name in ("dx_m", "dy_m", "dz_m"))


def _columns(*names: str) -> Table:
    """A table whose first column is text and whose others are numbers."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for number, name in enumerate(names):
        table.add_column(name, justify="right" if number else "left")
    return table


def examine(
    project_file: Path, out: str | None, overrides: tuple[str, ...], data: Path | None, *, as_json: bool
) -> int:
    """Examine a project and print the findings; wrong input raises InputError."""
    show_progress()
    request = RunRequest.of(project_file, out, overrides, data)
    if out is not None:
        require_folder(request.directory)
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
    console = screen()
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
    print_listed(console, problems, "yellow")
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
