"""Runs as rows of the production database, and the entries that record an end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, cast

from sqlalchemy import Row

from tasks.files.json_text import JSON, finite, from_json, json_text
from tasks.production.run_record import PAUSES_S, RunRecord, StageTime, State, next_beginning, with_prospect
from tasks.production.tables import RUNS

_TIMES = ("scheduled", "begun", "ended", "again_at")


def as_row(run: RunRecord) -> dict[str, object]:
    """A run as the table of runs holds it."""
    times = {name: time_text(value) for name in _TIMES if (value := getattr(run, name))}
    plain = {column.name: getattr(run, column.name) for column in RUNS.columns}
    summary = None if run.summary is None else json_text(finite(run.summary))
    return {**plain, "stages": stages_text(run.stages), "summary": summary, **times}


def as_record(row: Row[Any]) -> RunRecord:
    """A run from its row."""
    content = dict(row._mapping)
    for name in _TIMES:
        content[name] = None if content[name] is None else datetime.fromisoformat(content[name])
    content["stages"] = tuple(StageTime(**stage) for stage in from_json(content["stages"]))
    content["summary"] = None if content["summary"] is None else from_json(content["summary"])
    return RunRecord(**content)


def stages_text(stages: Sequence[StageTime]) -> str:
    """Stages as JSON."""
    return json_text(cast(JSON, [asdict(stage) for stage in stages]))


def time_text(time: datetime) -> str:
    """A time in UTC; texts are in the order of their times."""
    return time.astimezone(UTC).isoformat(timespec="milliseconds")


def ending(known: Row[Any], state: State, message: str, may_pass: bool) -> dict[str, object]:
    """What is noted of every end: its state, and when the run is started again by itself."""
    now = datetime.now(UTC)
    ended = {"state": state, "ended": time_text(now)}
    if not may_pass or state not in PAUSES_S:
        return {**ended, "message": message, "again_at": None}
    again_at = next_beginning(state, known.attempts, now)
    told = with_prospect(message, known.attempts, again_at)
    return {**ended, "message": told, "again_at": None if again_at is None else time_text(again_at)}
