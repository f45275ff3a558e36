"""Examine a project: read and check it, compute approximate values, adjust nothing.

What a run would stop at is one mistake; the doctor continues behind it wherever the rest can be judged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar, cast

from pydantic import TypeAdapter

from flows.runs.stage import stage
from flows.stories.block_preparation import ImportedBlock, import_block
from tasks.errors import AerocalError, InputError
from tasks.files.json_text import JSON
from tasks.settings.declared_line import input_table, with_declared
from tasks.settings.project import Project
from tasks.stages import diagnosis
from tasks.store.notes import read_notes
from tasks.store.store import Outputs, Store

_NAMES = ("exposures and cameras", "control", "image points", "approximate values")
# Mistakes of the import that are corrected one after the other.
_MOST_CORRECTED = 8
# A part of the points with one ray, above which it is no matter of single mismatches any more.
_SINGLE_RAYS = 0.05
T = TypeVar("T")

diagnose = stage(diagnosis.diagnose)


@dataclass(frozen=True)
class Finding:
    """What one stage found.

    Attributes
    ----------
    subject : what was checked.
    figures : counts and numbers.
    problems : suspicions, plain sentences.
    """

    subject: str
    figures: Mapping[str, JSON]
    problems: tuple[str, ...]


@dataclass(frozen=True)
class ListedMistake:
    """One line of the doctor's list.

    Attributes
    ----------
    what : what it looks like.
    evidence : what was measured under each hypothesis.
    remedy : what to do.
    declare : the line of the project file; empty: the files must be corrected.
    """

    what: str
    evidence: tuple[str, ...]
    remedy: str
    declare: str


_MISTAKES = TypeAdapter(list[ListedMistake])


@dataclass
class Examination:
    """All that was found.

    Attributes
    ----------
    findings : of the stages that could be carried out.
    mistakes : the list.
    refusal : what a run of the project as it stands would stop at.
    """

    findings: list[Finding] = field(default_factory=list)
    mistakes: list[ListedMistake] = field(default_factory=list)
    refusal: AerocalError | None = None


def _finding(name: str, outputs: Outputs) -> Finding:
    note = read_notes(outputs["notes"])
    return Finding(name, note.figures, note.problems)


def examine_everything(project: Project, store: Store) -> Examination:
    """The list of all mistakes of a delivery, as far as they can be judged one after another."""
    found = Examination()
    imported = _imported(project, store, found)
    if imported is None:
        return found
    project, read = imported
    points = read.imported[0] if read.imported else read.image_points
    for name, outputs in zip(_NAMES, (read.exposures, read.control, points), strict=False):
        found.findings.append(_finding(name, outputs))
    corrected = bool(found.mistakes)
    found.mistakes += _single_rays(points)
    outcome = _attempt(lambda: read.approximated(project, store, project.adjustment.free))
    tables = {name: table for name, table in read.tables.items() if name != "distances"}
    looked = diagnose(
        store,
        **tables,
        project=project.project,
        checks=project.checks,
        sources=project.inputs.exposures,
        points_sources=project.inputs.image_points,
        control_sources=project.inputs.control,
        camera_settings=project.cameras,
        free=tuple(project.adjustment.free),
    )
    diagnosed = _listed(looked)
    found.mistakes += diagnosed
    if isinstance(outcome, AerocalError):
        explained = any(mistake.evidence for mistake in diagnosed)
        if not corrected:
            found.refusal = outcome
        if not explained:
            found.mistakes.append(_of_error(outcome))
    else:
        found.findings.append(_finding(_NAMES[3], outcome.approximate))
    return found


def _listed(outputs: Outputs) -> list[ListedMistake]:
    return _MISTAKES.validate_python(read_notes(outputs["notes"]).figures["mistakes"])


def _single_rays(points: Outputs) -> list[ListedMistake]:
    """Object points with one ray, if there are so many that names may differ between files."""
    note = read_notes(points["notes"])
    counts = cast(Mapping[str, int], note.figures["counts"])
    single, all_points = counts["single_ray_points"], counts["object_points"] + counts["single_ray_points"]
    if single <= _SINGLE_RAYS * all_points:
        return []
    what = next(text for text in note.problems if "measured in one image only" in text)
    share = f"{100.0 * single / all_points:.1f} % of {all_points:,} object points"
    return [
        ListedMistake(
            what, (share,), "Check that all files use the same name for a point, or exclude these points.", ""
        )
    ]


def _imported(project: Project, store: Store, found: Examination) -> tuple[Project, ImportedBlock] | None:
    """The imports, with what stops them corrected or set aside; None if the rest cannot be judged."""
    for _ in range(_MOST_CORRECTED):
        read = _attempt(lambda project=project: import_block(project, store))  # type: ignore[misc]
        if not isinstance(read, AerocalError):
            return project, read
        found.refusal = found.refusal or read
        mistake, rest = _going_on(project, read)
        found.mistakes.append(mistake)
        if rest is None:
            return None
        project = rest
    return None


def _going_on(project: Project, error: AerocalError) -> tuple[ListedMistake, Project | None]:
    """The mistake behind an error, and the project with which the rest can be judged."""
    if not isinstance(error, InputError):
        return _of_error(error), None
    table = input_table(project, error.file)
    if table is None:
        return _of_error(error), None
    if error.declare is not None:
        line = f"{table.name}.{error.declare}"
        return _of_error(error, line), with_declared(project, table, error.declare)
    # Without the file there may be enough to judge the others by.
    return _of_error(error), table.without(project)


def _of_error(error: AerocalError, declare: str = "") -> ListedMistake:
    if not isinstance(error, InputError):
        return ListedMistake(str(error), (), "", declare)
    place = "" if error.file is None else f"{error.file.name}{f':{error.line}' if error.line else ''}: "
    entity = f"{error.entity}: " if error.entity else ""
    return ListedMistake(f"{place}{entity}{error.what}", (), error.remedy, declare)


def _attempt(action: Callable[[], T]) -> T | AerocalError:
    try:
        return action()
    except AerocalError as error:
        return error
