"""The tables of production; times are text (ISO 8601, UTC), the same characters in every database."""

from __future__ import annotations

from sqlalchemy import Column, Index, Integer, MetaData, Table, Text

#: Version of these tables; another one is refused.
SCHEMA_VERSION = 2

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
    Column("scheduled", Text, nullable=False, index=True),
    Column("begun", Text),
    Column("ended", Text),
    Column("delivery", Text, index=True),
    Column("host", Text),
    Column("process", Integer),
    Column("attempts", Integer, nullable=False),
    Column("again_at", Text, index=True),
    Column("stages", Text, nullable=False),
    Column("failed_stage", Text),
    Column("summary", Text),
)

NOTICES = Table(
    "aerocal_notices",
    METADATA,
    Column("id", Text, primary_key=True),
    Column("written", Text, nullable=False),
    Column("content", Text, nullable=False),
    Column("closed", Text, index=True),
)

NOTICE_DELIVERIES = Table(
    "aerocal_notice_deliveries",
    METADATA,
    Column("notice", Text, primary_key=True),
    Column("address", Text, primary_key=True),
    Column("state", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("due", Text, nullable=False),
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
