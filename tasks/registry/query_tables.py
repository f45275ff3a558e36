"""Parameters and covariances of a record as rows, for SQL queries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

from sqlalchemy import Connection, Table, insert, select

from tasks.calibration.record import CalibrationRecord
from tasks.registry.contents import Contents, Finding, StoredCalibration
from tasks.registry.tables import COVARIANCES, PARAMETERS

Row: TypeAlias = Mapping[str, str | float | int | None]
# One statement for so many rows: a thousand round trips take seconds.
_AT_ONCE = 500


def write_rows(connection: Connection, number: int, record: CalibrationRecord) -> None:
    """Write the parameters and covariances of a new record."""
    for table, rows in ((PARAMETERS, parameter_rows(record)), (COVARIANCES, covariance_rows(record))):
        whole = [{"calibration": number, **row} for row in rows]
        for start in range(0, len(whole), _AT_ONCE):
            connection.execute(insert(table).values(whole[start : start + _AT_ONCE]))


def row_findings(connection: Connection, contents: Contents) -> tuple[Finding, ...]:
    """Findings where the rows differ from the records."""
    of_records = (f for item in contents.calibrations for f in record_row_findings(connection, item))
    known = {event.calibration for event in contents.events}
    return (*of_records, *_stray_findings(connection, known))


def _stray_findings(connection: Connection, known: set[int]) -> Iterator[Finding]:
    """Rows of calibrations that do not exist."""
    for table in (PARAMETERS, COVARIANCES):
        for number in connection.execute(select(table.c.calibration).distinct()).scalars():
            if number not in known:
                yield Finding(f"Table {table.name} has rows of a calibration {number} that does not exist.")


def record_row_findings(connection: Connection, item: StoredCalibration) -> Iterator[Finding]:
    """Findings where the rows of one record differ from its content; the first row of each table."""
    for table, expected in (
        (PARAMETERS, parameter_rows(item.record)),
        (COVARIANCES, covariance_rows(item.record)),
    ):
        found = _rows_by_key(table, _stored_rows(connection, table, item.id))
        wanted = _rows_by_key(table, expected)
        differing = [key for key in {**wanted, **found} if wanted.get(key) != found.get(key)]
        if differing:
            yield Finding(
                f"{item.label[0].upper()}{item.label[1:]}: table {table.name} differs from the record in "
                f"{len(differing)} row(s), the first one {' '.join(map(str, differing[0]))}.",
                item.id,
            )


def parameter_rows(record: CalibrationRecord) -> list[Row]:
    """One row for every parameter."""
    names = ("parameter", "entity", "unit", "value", "sigma", "verdict")
    return [{name: getattr(item, name) for name in names} for item in record.parameters]


def covariance_rows(record: CalibrationRecord) -> list[Row]:
    """One row for every pair of estimated parameters."""
    keys = [item.key for item in record.estimated]
    return [
        {
            "parameter_a": keys[i][0],
            "entity_a": keys[i][1],
            "parameter_b": keys[j][0],
            "entity_b": keys[j][1],
            "covariance": record.covariance[i][j],
        }
        for i in range(len(keys))
        for j in range(i + 1)
    ]


def _stored_rows(connection: Connection, table: Table, number: int) -> list[Row]:
    statement = select(table).where(table.c.calibration == number)
    return [
        {name: value for name, value in row.items() if name != "calibration"}
        for row in connection.execute(statement).mappings()
    ]


def _rows_by_key(table: Table, rows: Sequence[Row]) -> dict[tuple[object, ...], Row]:
    names = [column.name for column in table.primary_key if column.name != "calibration"]
    return {tuple(row[name] for name in names): dict(row) for row in rows}
