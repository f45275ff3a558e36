"""Write the tables of docs/artifacts.md from the schemas: ``python -m docs.generate.tables``.

The page has a hand-written head; what follows its marker line is written by this module. It cannot be
out of date: a test compares the committed page with what would be written.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from tasks.results.publish import OF_SWEEPS, PUBLISHED
from tasks.tables.schemas.columns import Column, TableSchema
from tasks.tables.schemas.register import SCHEMAS

MARKER = "<!-- The rest is written by python -m docs.generate.tables from tasks/tables/schemas. -->"


def with_tables(page: str) -> str:
    """The page with everything below its marker line written again.

    Raises
    ------
    ValueError
        If the page has no marker line.
    """
    head, marker, _ = page.partition(MARKER)
    if not marker:
        raise ValueError(f"the page lacks the line {MARKER}")
    return "\n".join([head + marker, "", *_tables()]).rstrip() + "\n"


def _tables() -> Iterator[str]:
    yield "## Published tables"
    yield ""
    for name in (*PUBLISHED, *OF_SWEEPS):
        yield from _section(SCHEMAS[name])
    yield "## Tables that stay in the store"
    yield ""
    yield "Intermediate results below `.store/`, in the same form."
    yield ""
    for name, schema in SCHEMAS.items():
        if name not in (*PUBLISHED, *OF_SWEEPS):
            yield from _section(schema)


def _section(schema: TableSchema) -> Iterator[str]:
    yield f"### `{schema.name}.parquet`"
    yield ""
    key = ", ".join(f"`{name}`" for name in schema.key)
    geometry = "; GeoParquet with points" if schema.coordinates else ""
    yield f"{schema.meaning} Key and order of rows: {key}{geometry}; version {schema.version}."
    yield ""
    yield "| column | type | unit | null | meaning |"
    yield "|---|---|---|---|---|"
    for column in schema.columns:
        yield _row(column)
    if schema.coordinates:
        yield f"| `geometry` | WKB | | if unknown | point of {', '.join(schema.coordinates)} |"
    yield ""


def _row(column: Column) -> str:
    null = "yes" if column.nullable else ""
    meaning = column.meaning.replace("|", "\\|")
    if column.values:
        meaning += ": " + ", ".join(f"`{value}`" for value in column.values)
    return f"| `{column.name}` | {column.type} | {column.unit} | {null} | {meaning} |"


def main() -> None:
    """Rewrite the page in docs/ of the repository the command is run in, or at the path given."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/artifacts.md")
    target.write_text(with_tables(target.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
