"""The board of production: every project's latest run, kept up to date with as little reading as possible.

Records are requested a few columns of the latest runs every time, and for the whole (with its summary) only
where these have changed. Every row carries the number of the change it came with, so that a page in a browser
is sent what it has not got yet and nothing else.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from tasks.production.project_row import ProjectRow, project_row
from tasks.production.project_row import key_of as project_key
from tasks.production.records import LatestRun, Records
from tasks.production.run_record import RunRecord
from tasks.production.stage_states import stages_so_far


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
            if (id := one.row.run.id) not in found or (id in fresh and project_key(fresh[id]) != key)
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
