"""docs/artifacts.md says what the schemas, the summary, the manifest and the exit codes are."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.generate.tables import MARKER, with_tables
from flows.command import exit_code, interruption
from tasks.results.manifest import Manifest
from tasks.results.publish import (
    DOCUMENTS,
    OF_CALIBRATIONS,
    OF_CHECKS,
    OF_IMAGE_QUALITY,
    OF_SWEEPS,
    PUBLISHED,
)
from tasks.results.summary import Counts, Summary
from tasks.tables.schemas.register import SCHEMAS

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = REPOSITORY / "docs" / "artifacts.md"
TEXT = PAGE.read_text(encoding="utf-8")


def part(heading: str) -> str:
    """The text of one chapter of the page."""
    return TEXT.split(f"\n## {heading}\n")[1].split("\n## ")[0]


def named_fields(chapter: str) -> set[str]:
    """The names in the first column of a table."""
    return {
        name for row in re.findall(r"^\| (`.*?) \|", chapter, re.M) for name in re.findall(r"`(\w+)`", row)
    }


def test_the_committed_tables_are_up_to_date() -> None:
    message = "run `python -m docs.generate.tables` and commit docs/artifacts.md"
    assert with_tables(TEXT) == TEXT, message


def test_the_command_writes_the_same_page_from_its_head_alone(tmp_path: Path) -> None:
    page = tmp_path / "artifacts.md"
    page.write_text(TEXT.partition(MARKER)[0] + MARKER + "\n", encoding="utf-8")
    command = [sys.executable, "-m", "docs.generate.tables", str(page)]
    subprocess.run(command, cwd=REPOSITORY, check=True)
    assert page.read_text(encoding="utf-8") == TEXT


def test_a_page_without_the_marker_line_is_refused() -> None:
    with pytest.raises(ValueError, match="lacks the line"):
        with_tables("# Artifacts\n")


def test_every_table_and_column_is_listed_once() -> None:
    assert set(PUBLISHED) <= set(SCHEMAS)
    for schema in SCHEMAS.values():
        assert TEXT.count(f"### `{schema.name}.parquet`") == 1
        section = TEXT.split(f"### `{schema.name}.parquet`")[1].split("\n### ")[0]
        for column in schema.columns:
            assert section.count(f"| `{column.name}` | {column.type} |") == 1


def test_every_file_that_is_no_table_is_in_the_list_of_files() -> None:
    files = TEXT.split("\n## ")[0]
    names = {*DOCUMENTS, *OF_CALIBRATIONS, *OF_CHECKS, *OF_IMAGE_QUALITY, *OF_SWEEPS} - set(SCHEMAS)
    missing = [name for name in names if f"`{name}`" not in files and f"`{name}." not in files]
    assert not missing


def test_every_field_of_the_summary_is_explained() -> None:
    fields = named_fields(part("summary.json"))
    assert set(Summary.model_fields) <= fields
    assert all(f"`{name}`" in part("summary.json") for name in Counts.model_fields)


def test_every_field_of_the_manifest_is_explained_and_no_other() -> None:
    assert named_fields(part("manifest.json")) == set(Manifest.model_fields)


def test_the_exit_codes_are_those_of_the_command_line() -> None:
    rows = re.findall(r"^\| (\d+) \| (?:`(\w+)`)? ?\|", part("Exit codes"), re.M)
    listed = {int(code): status for code, status in rows}
    assert {status: code for code, status in listed.items() if status} == exit_code.OF_STATUS
    others = {exit_code.DEFECT, interruption.INTERRUPTED, interruption.TERMINATED}
    assert set(listed) == others | set(exit_code.OF_STATUS.values())
