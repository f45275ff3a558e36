"""JSON has one loader, and what it reads has one meaning."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tasks.files.json_text import from_json, read_json
from tests.conftest import REPOSITORY


@pytest.mark.parametrize(
    "text", ['{"a": 1, "a": 1}', '[{"b": {"a": 1, "c": 2, "a": 3}}]', '{"é": 1, "\\u00e9": 2}']
)
def test_a_key_that_stands_twice_is_refused_at_any_depth(text: str) -> None:
    with pytest.raises(ValueError, match="exists twice"):
        from_json(text)


@pytest.mark.parametrize("text", ["[NaN]", "[Infinity]", '{"a": -Infinity}'])
def test_what_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a number"):
        from_json(text)


def test_a_file_is_read_by_the_same_rules(tmp_path: Path) -> None:
    file = tmp_path / "x.json"
    file.write_text('{"a": [1, {"b": 2.5}], "c": null}')
    assert read_json(file) == {"a": [1, {"b": 2.5}], "c": None}
    file.write_text('{"a": 1, "a": 2}')
    with pytest.raises(ValueError, match="twice"):
        read_json(file)


def test_nothing_else_under_tasks_parses_json() -> None:
    """pydantic and the standard library take the last of two values in silence."""
    found = {
        str(path.relative_to(REPOSITORY))
        for path in (REPOSITORY / "tasks").rglob("*.py")
        if re.search(r"\bjson\.loads?\(|model_validate_json\(", path.read_text(encoding="utf-8"))
    }
    # The records of the registry are read from what `json_text` has written of what `from_json` had read.
    records = {"tasks/registry/calibration_file.py", "tasks/registry/radiometric.py"}
    assert found == {"tasks/files/json_text.py"} | records
