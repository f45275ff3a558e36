"""The production database: every run of every project and its state.

Prefect's own records may be tidied up, lost or started again; what was done with a delivery is
remembered here.
A run that is decided is never changed again, except that it may begin again under the same number.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Column, Connection, Row, Select, func, insert, inspect, select, update
from sqlalchemy.dialects import postgresql, sqlite

from tasks.database.address import Holding, database_address
from tasks.database.engine import Database, connected_for_reading, engine_at
from tasks.database.errors import in_words
from tasks.files.json_text import JSON
from tasks.files.machine import machine
from tasks.production.notice import Notice, notice_of_run
from tasks.production.run_record import (
    DECIDED,
    LONGEST_PAUSE_S,
    PUBLISHING,
    RECORDS_VARIABLE,
    SWEEP,
    RunFigures,
    RunRecord,
    StageTime,
    State,
    ending,
    given_up,
)
from tasks.production.tables import METADATA, NOTICES, RUNS, SCHEMA, SCHEMA_VERSION

#: What messages call them.
RECORDS = Holding("record of runs", f"--database or {RECORDS_VARIABLE}")
#: Values that are requested in one statement.
_BATCH = 500
# A sweep next to an adjustment replaces none of its files, and the other way round.
_IS_SWEEP = RUNS.c.story == SWEEP


@dataclass(frozen=True)
class LatestRun:
    """The latest run of a story on a project file, reduced to what shows whether something has changed.

    Attributes
    ----------
    id, state, begun, ended, attempts : as of `RunRecord`.
    runs : how many runs there are.
    has_results : whether its output folder holds what this run has published.
    """

    id: str
    state: str
    begun: datetime | None
    ended: datetime | None
    attempts: int
    runs: int
    has_results: bool


@dataclass(frozen=True)
class Records(Database):
    """The records of production.

    Every method raises `InputError` if the database is none of ours and `InstallationError` if it cannot be
    reached or written.
    """

    schema, version = SCHEMA, SCHEMA_VERSION
    creation_lock = 0x6165726F72756E
    other_version = "name a new database"

    @classmethod
    def at(cls, address: str, environment: Mapping[str, str] = os.environ) -> Records:
        """The records at an address: path of a SQLite file, or ``postgresql://USER@HOST/DATABASE``."""
        found = database_address(address, RECORDS, environment)
        return cls(found, engine_at(found))

    def schedule(self, run: RunRecord) -> None:
        """Record a run that will begin; for a known one, only the delivery it is for."""
        with self.writing() as connection:
            known = _known_or_inserted(connection, run)
            if known is not None and known.delivery is None and run.delivery is not None:
                # It was started before whoever scheduled it came to note it.
                _update(connection, run.id, delivery=run.delivery)

    def begin(self, run: RunRecord) -> None:
        """Record that a run begins in this process, for the first time or again."""
        begun = replace(
            run,
            state="Running",
            begun=datetime.now(UTC),
            ended=None,
            again_at=None,
            attempts=1,
            host=machine(),
            process=os.getpid(),
        )
        with self.writing() as connection:
            known = _known_or_inserted(connection, begun)
            if known is None:
                return
            # After an end that was to stay, somebody has requested it again.
            attempts = 1 if known.has_ended else known.attempts
            begun = replace(begun, attempts=attempts, delivery=known.delivery, scheduled=known.scheduled)
            _update(connection, run.id, **_values(begun))

    def reschedule(self, run_id: str, message: str) -> None:
        """Record that a run which had started waits for a requested restart."""
        with self.writing() as connection:
            _update(connection, run_id, **_waiting(message))

    def begin_again(self, run: RunRecord, message: str) -> bool:
        """Record that a due run is to be restarted; False if it is no longer due.

        Of several that find the same run due, one gets True.
        """
        due = (RUNS.c.id == run.id) & RUNS.c.again_at.is_not(None) & (RUNS.c.attempts == run.attempts)
        values = {**_waiting(message), "attempts": run.attempts + 1}
        with self.writing() as connection:
            return connection.execute(update(RUNS).where(due).values(values)).rowcount == 1

    def give_up(self, run_id: str) -> None:
        """Record that an ended run is not restarted automatically."""
        with self.writing() as connection:
            known = _record_of(connection, run_id)
            if known is not None and known.again_at is not None:
                _update(connection, run_id, **given_up(known.message))
                _tell(connection, run_id)

    def end(
        self,
        run_id: str,
        state: State,
        message: str,
        *,
        may_pass: bool = False,
        stages: Sequence[StageTime] = (),
        failed_stage: str | None = None,
        summary: Mapping[str, JSON] | None = None,
    ) -> None:
        """Record how a run ended, as reported by itself, and its notice; nothing if already decided.

        It holds even if the run was given up for lost before: it was only out of sight.

        Parameters
        ----------
        may_pass : whether the reason lies with the machine and may be gone another time.
        """
        with self.writing() as connection:
            known = _record_of(connection, run_id)
            if known is not None and known.state not in DECIDED:
                end = ending(known.attempts, state, message, may_pass=may_pass)
                _update(connection, run_id, **end, stages=stages, failed_stage=failed_stage, summary=summary)
                _tell(connection, run_id)

    def lose(self, run_id: str, state: State, message: str, *, may_pass: bool = True) -> None:
        """Record how a run ended that could not report it; nothing if it has ended or is unknown.

        Parameters
        ----------
        may_pass : as of `end`; of the states, only some are started again (`tasks.production.run_record`).
        """
        with self.writing() as connection:
            known = _record_of(connection, run_id)
            if known is not None and known.ended is None:
                _update(connection, run_id, **ending(known.attempts, state, message, may_pass=may_pass))
                _tell(connection, run_id)

    def runs(
        self, states: Collection[str] | None = None, most: int | None = None, **of: str
    ) -> tuple[RunRecord, ...]:
        """The runs, the latest first.

        Parameters
        ----------
        states : only of these.
        most : not more than these.
        of : only those with these values, such as `project_file`.
        """
        chosen = select(RUNS).filter_by(**of).order_by(RUNS.c.scheduled.desc(), RUNS.c.id).limit(most)
        return self._read(chosen if states is None else chosen.where(RUNS.c.state.in_(sorted(states))))

    def due(self, now: datetime) -> tuple[RunRecord, ...]:
        """The runs to be restarted automatically, the longest due first.

        One that is due later than any pause is long was written by a clock that runs ahead: it is due.
        """
        beyond = now + timedelta(seconds=LONGEST_PAUSE_S)
        due = (RUNS.c.again_at <= now) | (RUNS.c.again_at > beyond)
        return self._read(select(RUNS).where(due).order_by(RUNS.c.again_at))

    def run(self, run_id: str) -> RunRecord | None:
        """A run by its number; None if unknown."""
        return next(iter(self.runs(id=run_id)), None)

    def of_deliveries(self, keys: Sequence[str]) -> dict[str, RunRecord]:
        """By key, the latest run of the deliveries that have one; without figures, which are slow to read."""
        chosen = select(*(column for column in RUNS.c if column is not RUNS.c.summary))
        latest_last = chosen.order_by(RUNS.c.scheduled, RUNS.c.id.desc())
        return {str(run.delivery): run for run in self._with(latest_last, RUNS.c.delivery, keys)}

    def runs_with(self, ids: Sequence[str]) -> tuple[RunRecord, ...]:
        """The known runs among these numbers."""
        return self._with(select(RUNS), RUNS.c.id, ids)

    def latest(self) -> tuple[LatestRun, ...]:
        """The latest run of every story on every project file, without the parts that are slow to read."""
        alike = (RUNS.c.project_file, RUNS.c.project, RUNS.c.story)
        waits = RUNS.c.begun.is_(None) & RUNS.c.ended.is_(None)
        # One that somebody has started again is later than what was scheduled after it.
        begun = func.coalesce(RUNS.c.begun, RUNS.c.scheduled)
        newest_first = (waits.desc(), begun.desc(), RUNS.c.scheduled.desc(), RUNS.c.id)
        ranked = select(
            RUNS.c.id, RUNS.c.state, RUNS.c.begun, RUNS.c.ended, RUNS.c.attempts,
            func.row_number().over(partition_by=alike, order_by=newest_first).label("place"),
            func.count().over(partition_by=alike).label("runs"),
        ).subquery()  # fmt: skip
        published = select(
            RUNS.c.id,
            func.row_number()
            .over(partition_by=(RUNS.c.directory, _IS_SWEEP), order_by=(RUNS.c.ended.desc(), RUNS.c.id))
            .label("place"),
        ).where(RUNS.c.state.in_(PUBLISHING))
        placed = published.subquery()
        # Two questions: a join of both takes a database long that has no index on either.
        holders = {row.id for row in self.rows(select(placed.c.id).where(placed.c.place == 1))}
        return tuple(
            LatestRun(row.id, row.state, row.begun, row.ended, row.attempts, row.runs, row.id in holders)
            for row in self.rows(select(ranked).where(ranked.c.place == 1))
        )

    def tally(self) -> tuple[tuple[str, str, int, datetime | None], ...]:
        """For every story and state: how many runs are in it, and when the latest of them ended."""
        chosen = select(
            RUNS.c.story, RUNS.c.state, func.count().label("number"), func.max(RUNS.c.ended).label("last")
        )
        rows = self.rows(chosen.group_by(RUNS.c.story, RUNS.c.state).order_by(RUNS.c.story, RUNS.c.state))
        return tuple((row.story, row.state, row.number, row.last) for row in rows)

    def holds_results(self, run: RunRecord) -> bool:
        """Whether the output folder of a run still holds what that run has published."""
        of_its_kind = _IS_SWEEP if run.story == SWEEP else ~_IS_SWEEP
        chosen = select(RUNS.c.id).where(
            (RUNS.c.directory == run.directory) & RUNS.c.state.in_(PUBLISHING) & of_its_kind
        )
        found = self.rows(chosen.order_by(RUNS.c.ended.desc(), RUNS.c.id).limit(1))
        return [row.id for row in found] == [run.id]

    def prepare(self) -> None:
        """Create missing tables."""
        with self.writing():
            pass

    def _with(self, chosen: Select[Any], column: Column[str], values: Sequence[str]) -> tuple[RunRecord, ...]:
        """The chosen runs whose value in a column is one of these."""
        parts = (values[first : first + _BATCH] for first in range(0, len(values), _BATCH))
        return tuple(run for part in parts for run in self._read(chosen.where(column.in_(part))))

    def _read(self, statement: Any) -> tuple[RunRecord, ...]:
        return tuple(_record(row) for row in self.rows(statement))

    def rows(self, statement: Any) -> tuple[Row[Any], ...]:
        """The rows that a statement finds in one state of the database; empty if it does not exist yet."""
        file = self.address.file
        if file is not None and not file.is_file():
            return ()
        with in_words(self.address), connected_for_reading(self.engine) as connection:
            if not inspect(connection).has_table(SCHEMA.name):
                return ()
            self.require_version(connection)
            return tuple(connection.execute(statement))

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction that may write; missing tables are created."""
        with self.transaction() as connection:
            if not set(METADATA.tables) <= set(inspect(connection).get_table_names()):
                self.wait_to_create(connection)
                # A table that has come since is made next to the others.
                METADATA.create_all(connection)
                if connection.execute(select(SCHEMA.c.version)).first() is None:
                    connection.execute(insert(SCHEMA).values(version=SCHEMA_VERSION))
            self.require_version(connection)
            yield connection


def configured_records(environment: Mapping[str, str] = os.environ) -> Records | None:
    """The records of this process; None: there is no server that keeps any."""
    address = environment.get(RECORDS_VARIABLE)
    return Records.at(address, environment) if address else None


def write_notice(connection: Connection, notice: Notice) -> None:
    """Put a notice into the outbox, unless it is there already."""
    if connection.execute(select(NOTICES.c.id).where(NOTICES.c.id == notice.id)).first() is None:
        values = {"id": notice.id, "written": datetime.now(UTC), "content": notice.to_text()}
        connection.execute(insert(NOTICES).values(**values))


def _record(row: Row[Any]) -> RunRecord:
    content = dict(row._mapping)
    figures = content.pop("summary", None) or RunFigures()
    return RunRecord(**content, figures=figures)


def _record_of(connection: Connection, run_id: str) -> RunRecord | None:
    """A run, locked against other writers until the end of the transaction."""
    row = connection.execute(select(RUNS).where(RUNS.c.id == run_id).with_for_update()).first()
    return None if row is None else _record(row)


def _known_or_inserted(connection: Connection, run: RunRecord) -> RunRecord | None:
    """What is on record of a run; None: nothing was, and it is on record now."""
    known = _record_of(connection, run.id)
    if known is not None:
        return known
    # Between the two, another process may record it: its scheduling and its beginning may meet. No savepoint,
    # which SQLite has lost when a disk is full; what is said would be about that.
    dialect = sqlite if connection.dialect.name == "sqlite" else postgresql
    new = dialect.insert(RUNS).values(_values(run)).on_conflict_do_nothing()
    return None if connection.execute(new).rowcount else _record_of(connection, run.id)


def _values(run: RunRecord) -> dict[str, object]:
    """A run that has not ended, as its row."""
    content = {**vars(run), "summary": None}
    del content["figures"]
    return content


def _waiting(message: str) -> dict[str, object]:
    return {"state": "Scheduled", "message": message, "ended": None, "again_at": None}


def _update(connection: Connection, run_id: str, **values: object) -> None:
    connection.execute(update(RUNS).where(RUNS.c.id == run_id).values(values))


def _tell(connection: Connection, run_id: str) -> None:
    """Put into the outbox how a run ended, unless it is restarted automatically."""
    run = _record_of(connection, run_id)
    notice = None if run is None or run.again_at is not None else notice_of_run(run)
    if notice is not None:
        write_notice(connection, notice)
