"""The board of production: every project's latest run, kept up to date with as little reading as possible.

Records are requested a few columns of the latest runs every time, and for the whole (with its summary) only
where these have changed. Every row carries the number of the change it came with, so that a page in a browser
is sent what it has not got yet and nothing else. Prefect shows runs and knows neither projects nor their
figures, limits and documents.
"""

from __future__ import annotations

import hashlib
import threading
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from tasks.production.records import LatestRun, Records
from tasks.production.run_record import NO_AXES, PUBLISHING, RunFigures, RunRecord, StageTime
from tasks.production.stages import StageState, stage_states, stages_so_far

#: Document of an output folder, by the stage that writes it.
DOCUMENTS: Mapping[str, str] = {
    "report": "report.html",
    "certificate": "certificate.html",
    "georeferencing_page": "georeferencing_check.html",
    "sweep_page": "sweep.html",
    "image_quality_page": "image_quality.html",
    "radiometric_certificate": "radiometric_certificate.html",
}


@dataclass(frozen=True)
class ProjectRow:
    """The latest run of a story on a project.

    Attributes
    ----------
    run : the run.
    stages : state of each stage the story has come to or will come to, in order.
    runs : runs of this story on this project file.
    documents : files of the output folder that this run wrote; empty if a later run has replaced them.
    """

    run: RunRecord
    stages: Mapping[str, StageState]
    runs: int
    documents: tuple[str, ...]

    @property
    def key(self) -> str:
        """The same for every run of this story on this project file."""
        return key_of(self.run)

    @property
    def failed_gates(self) -> tuple[str, ...]:
        """Names of the failed gates."""
        return tuple(gate.name for gate in self.run.figures.gates if not gate.passed)

    @property
    def changed(self) -> datetime:
        """Time of the last change of its state."""
        return self.run.ended or self.run.begun or self.run.scheduled

    @property
    def seconds(self) -> float | None:
        """Duration, s; None: it has not ended, or did not begin."""
        if self.run.begun is None or self.run.ended is None:
            return None
        return max((self.run.ended - self.run.begun).total_seconds(), 0.0)

    @property
    def problem(self) -> str | None:
        """The sentence to be read first; None: there is nothing to say."""
        if self.run.state == "Running" and self.run.attempts > 1:
            return f"Attempt {self.run.attempts}; completed stages are reused."
        return next(iter(problems_of(self.run)), None)

    def limit(self, gate: str) -> float | None:
        """The largest value that passes a gate; None: it was not tested."""
        gates = self.run.figures.gates
        return next((one.limit for one in gates if one.name == gate and one.bound == "max"), None)


def project_row(run: RunRecord, *, runs: int, has_results: bool, done: Sequence[StageTime]) -> ProjectRow:
    """The row of a project from its latest run.

    Parameters
    ----------
    runs : how many there are.
    has_results : whether the output folder holds what this run has published.
    done : stages that have ended.
    """
    wrote = {one.stage for one in run.stages}
    written = tuple(document for stage, document in DOCUMENTS.items() if stage in wrote)
    return ProjectRow(run, stage_states(run, done), runs, written if has_results else ())


def key_of(run: RunRecord) -> str:
    """The same text for every run of a story on a project file, and for no other."""
    told = "\0".join((run.project_file, run.project, run.story))
    return hashlib.sha256(told.encode("utf-8", "surrogatepass")).hexdigest()[:24]


def problems_of(run: RunRecord) -> tuple[str, ...]:
    """The problems and remarks of a run in order; files of the project by their names."""
    said = run.figures.problems
    if run.state not in PUBLISHING and run.message:
        said = tuple(dict.fromkeys((run.message, *said)))
    return tuple(in_project(run, sentence) for sentence in said)


def in_project(run: RunRecord, sentence: str) -> str:
    """A sentence on a project with the project's folder left out of paths."""
    folder = run.project_file.rpartition("/")[0]
    return sentence.replace(f"{folder}/", "") if folder else sentence


def with_figures(rows: Sequence[ProjectRow], most: int = 300) -> tuple[ProjectRow, ...]:
    """The rows with σ0 or check points, the latest ones, in the order of time."""
    ended = [row for row in rows if row.run.ended is not None and _has_figures(row.run.figures)]
    return tuple(sorted(ended, key=lambda row: (row.changed, row.key))[-most:])


def _has_figures(figures: RunFigures) -> bool:
    return figures.sigma0 is not None or figures.rmse_check_m != NO_AXES


@dataclass(frozen=True)
class Revision:
    """The board, and its latest change, up to which a reader has its rows.

    Attributes
    ----------
    board : another one whenever the program begins again.
    number : of the change.
    """

    board: str
    number: int


@dataclass(frozen=True)
class Changes:
    """What is new on a board.

    Attributes
    ----------
    revision : up to which change.
    whole : whether `rows` is everything there is, and what was shown before is to be forgotten.
    rows : those that are new or have changed.
    removed : keys of rows that are gone.
    """

    revision: Revision
    whole: bool
    rows: tuple[ProjectRow, ...]
    removed: tuple[str, ...]

    @property
    def is_empty(self) -> bool:
        """Whether nothing is new."""
        return not (self.whole or self.rows or self.removed)


@dataclass(frozen=True)
class _Kept:
    """A row, what it was made from, and the change it came with."""

    latest: LatestRun
    row: ProjectRow
    changed: int


class Board:
    """Every project's latest run; safe for several threads.

    Parameters
    ----------
    records : the records of production.
    """

    def __init__(self, records: Records) -> None:
        self.records = records
        self._name = uuid.uuid4().hex
        self._number = 0
        self._kept: dict[str, _Kept] = {}
        self._removed: dict[str, int] = {}
        self._lock = threading.Lock()

    def rows(self) -> tuple[ProjectRow, ...]:
        """The rows as last read, the latest change first."""
        with self._lock:
            kept = list(self._kept.values())
        return tuple(sorted((one.row for one in kept), key=lambda row: row.changed, reverse=True))

    def changes(self, since: Revision | None) -> Changes:
        """What is new since a revision; everything if that is unknown.

        Raises
        ------
        InputError, InstallationError
            As of `Records`.
        """
        with self._lock:
            self._read()
            revision = Revision(self._name, self._number)
            if since is None or since.board != self._name:
                return Changes(revision, True, tuple(one.row for one in self._kept.values()), ())
            return Changes(
                revision,
                False,
                tuple(one.row for one in self._kept.values() if one.changed > since.number),
                tuple(key for key, number in self._removed.items() if number > since.number),
            )

    def _read(self) -> None:
        """Read what has changed in the records and in the output folders of active runs."""
        found = {one.id: one for one in self.records.latest()}
        known = {one.row.run.id: one for one in self._kept.values()}
        news = [id for id, latest in found.items() if id not in known or known[id].latest != latest]
        fresh = {run.id: run for run in self.records.runs_with(news)}
        in_work = [
            one.row.run
            for id, one in known.items()
            if one.row.run.state == "Running" and id in found and id not in fresh
        ]
        number = self._number + 1
        keys = {self._take(run, found[run.id], number) for run in (*fresh.values(), *in_work)}
        # A run that waits may not know its project file yet; when it begins it has another key.
        gone = {
            key
            for key, one in self._kept.items()
            if (id := one.row.run.id) not in found or (id in fresh and key_of(fresh[id]) != key)
        }
        for key in gone:
            del self._kept[key]
            self._removed[key] = number
        if gone or any(self._kept[key].changed == number for key in keys):
            self._number = number

    def _take(self, run: RunRecord, latest: LatestRun, number: int) -> str:
        done = stages_so_far(run) if run.state == "Running" else run.stages
        row = project_row(run, runs=latest.runs, has_results=latest.has_results, done=done)
        before = self._kept.get(row.key)
        if before is None or before.row != row or before.latest != latest:
            self._kept[row.key] = _Kept(latest, row, number)
            self._removed.pop(row.key, None)
        return row.key


#: States of projects in which somebody has to do something about the delivery, and in which the machine or
#: somebody ended the run.
WRONG_INPUT = ("InputError", "NotComputable")
BROKEN = ("Failed", "TimedOut", "Crashed", "Cancelled")


def oldest_waiting(rows: Sequence[ProjectRow]) -> datetime | None:
    """Since when the one has waited that waits longest; None: none waits."""
    return min((row.run.scheduled for row in rows if row.run.state == "Scheduled"), default=None)
