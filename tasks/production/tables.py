"""The tables of production; times are text (ISO 8601, UTC), the same characters in every database."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

from pydantic import TypeAdapter
from sqlalchemy import Column, Dialect, Index, Integer, MetaData, Table, Text, TypeDecorator

from tasks.files.json_text import JSON, finite, json_text
from tasks.production.run_record import RunFigures, StageTime

#: Version of these tables; another one is refused.
SCHEMA_VERSION = 2


class AsText(TypeDecorator[Any]):
    """A value that is kept as text.

    Parameters
    ----------
    text, value : of each other.
    """

    impl = Text
    cache_ok = True

    def __init__(self, text: Callable[[Any], str], value: Callable[[str], Any]) -> None:
        super().__init__()
        self.text, self.value = text, value

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:  # noqa: ARG002
        """As it is kept."""
        return None if value is None else self.text(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:  # noqa: ARG002
        """As it was."""
        return None if value is None else self.value(value)


def time_text(time: datetime) -> str:
    """A time in UTC; texts are in the order of their times."""
    return time.astimezone(UTC).isoformat(timespec="milliseconds")


def _summary_text(summary: Mapping[str, JSON]) -> str:
    return json_text(finite(summary))


_STAGES = TypeAdapter(tuple[StageTime, ...])
_TIME = AsText(time_text, datetime.fromisoformat)

METADATA = MetaData()

SCHEMA = Table("aerocal_schema", METADATA, Column("version", Integer, primary_key=True))

RUNS = Table(
    "aerocal_runs",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("project", Text, nullable=False),
    Column("project_file", Text, nullable=False, index=True),
    Column("directory", Text, nullable=False),
    Column("story", Text, nullable=False),
    Column("state", Text, nullable=False, index=True),
    Column("message", Text, nullable=False),
    Column("scheduled", _TIME, nullable=False, index=True),
    Column("begun", _TIME),
    Column("ended", _TIME),
    Column("delivery", Text, index=True),
    Column("host", Text),
    Column("process", Integer),
    Column("attempts", Integer, nullable=False),
    Column("again_at", _TIME, index=True),
    Column(
        "stages", AsText(lambda done: _STAGES.dump_json(done).decode(), _STAGES.validate_json), nullable=False
    ),
    Column("failed_stage", Text),
    # The whole summary is kept; only these are read.
    Column("summary", AsText(_summary_text, RunFigures.model_validate_json)),
)

NOTICES = Table(
    "aerocal_notices",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("written", _TIME, nullable=False),
    Column("content", Text, nullable=False),
    Column("closed", _TIME, index=True),
)

NOTICE_DELIVERIES = Table(
    "aerocal_notice_deliveries",
    METADATA,
    Column("notice", Text, primary_key=True),
    Column("address", Text, primary_key=True),
    Column("state", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("due", _TIME, nullable=False),
    Column("said", Text, nullable=False),
)
# What `Records.latest` reads, without the long rows themselves. A server keeps long values apart from its
# tables, and takes no such long keys.
Index(
    "aerocal_runs_latest",
    *(RUNS.c[name] for name in ("project_file", "project", "story", "scheduled", "id")),
    *(RUNS.c[name] for name in ("state", "begun", "ended", "attempts")),
).ddl_if(dialect="sqlite")
Index(
    "aerocal_runs_published",
    *(RUNS.c[name] for name in ("directory", "story", "state", "ended", "id")),
).ddl_if(dialect="sqlite")
