"""The tables of a registry.

Rows are written once and never changed; only the one row of ``registry_head`` moves on. Dates and times are
text (ISO 8601), so that they are the same characters in every database and in the digests over them.

The truth is ``calibrations.content``, the JSON of a record; parameters and covariances are in tables of
their own next to it so that they can be queried with SQL.
"""

from __future__ import annotations

from sqlalchemy import (
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)

#: Version of these tables; another one is refused.
SCHEMA_VERSION = 1

METADATA = MetaData()

SCHEMA = Table("registry_schema", METADATA, Column("version", Integer, primary_key=True))

#: How many there are, and the digest of the last event: every writer locks this row first.
HEAD = Table(
    "registry_head",
    METADATA,
    Column("one", Integer, CheckConstraint("one = 1"), primary_key=True),
    Column("calibrations", Integer, nullable=False),
    Column("events", Integer, nullable=False),
    Column("digest", Text, nullable=False),
)

CALIBRATIONS = Table(
    "calibrations",
    METADATA,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("camera_key", Text, nullable=False, index=True),
    Column("mounting_key", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("digest", Text, nullable=False, unique=True),
    Column("camera", Text, nullable=False),
    Column("flown", Text),
    Column("verdict", Text, nullable=False),
    Column("content", Text, nullable=False),
    UniqueConstraint("camera_key", "version"),
)

PARAMETERS = Table(
    "calibration_parameters",
    METADATA,
    Column("calibration", ForeignKey(CALIBRATIONS.c.id), primary_key=True),
    Column("parameter", Text, primary_key=True),
    Column("entity", Text, primary_key=True),
    Column("unit", Text, nullable=False),
    Column("value", Double, nullable=False),
    Column("sigma", Double),
    Column("verdict", Text, nullable=False),
)

#: Every pair of estimated parameters once, in the order of the record; a ≡ b is the variance.
COVARIANCES = Table(
    "calibration_covariances",
    METADATA,
    Column("calibration", ForeignKey(CALIBRATIONS.c.id), primary_key=True),
    Column("parameter_a", Text, primary_key=True),
    Column("entity_a", Text, primary_key=True),
    Column("parameter_b", Text, primary_key=True),
    Column("entity_b", Text, primary_key=True),
    Column("covariance", Double, nullable=False),
)

#: Radiometric examinations; tables that older registries lack, and get with their first result.
RADIOMETRIC = Table(
    "radiometric_results",
    METADATA,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("version", Integer, nullable=False),
    Column("content", Text, nullable=False),
    Column("person", Text, nullable=False),
    Column("at", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("previous", Text, nullable=False),
    Column("seal", Text, nullable=False, unique=True),
)
RADIOMETRIC_HEAD = Table(
    "radiometric_head",
    METADATA,
    Column("one", Integer, CheckConstraint("one = 1"), primary_key=True),
    Column("results", Integer, nullable=False),
    Column("seal", Text, nullable=False),
)

EVENTS = Table(
    "calibration_events",
    METADATA,
    Column("sequence", Integer, primary_key=True, autoincrement=False),
    Column("calibration", ForeignKey(CALIBRATIONS.c.id), nullable=False, index=True),
    Column("record_digest", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("valid_from", Text),
    Column("valid_to", Text),
    Column("successor", Integer),
    Column("person", Text, nullable=False),
    Column("at", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("although", Text, nullable=False),
    Column("previous", Text, nullable=False),
    Column("digest", Text, nullable=False, unique=True),
)
