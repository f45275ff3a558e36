"""The page on security names a test for each attack, and every one of them is there."""

from __future__ import annotations

import re

from tasks.files import delivered_file
from tests.conftest import REPOSITORY

PAGE = (REPOSITORY / "docs" / "security.md").read_text(encoding="utf-8")


def test_every_attack_has_tests_that_are_there() -> None:
    rows = re.findall(r"^\| (\d+) \| (.+?) \| .* \| (.*) \|$", PAGE, re.MULTILINE)
    assert [number for number, _, _ in rows] == [str(row) for row in range(1, 11)]
    for _, attack, tests in rows:
        named = re.findall(r"`(tests/[\w/]+\.py)`", tests)
        assert named, attack
        for file in named:
            assert "\ndef test_" in (REPOSITORY / file).read_text(encoding="utf-8"), file


def test_the_limits_are_those_of_the_program() -> None:
    usual = delivered_file.FileLimits()
    for variable, value in (
        (delivered_file.TABLE_VARIABLE, f"{usual.table_mb}"),
        (delivered_file.DOCUMENT_VARIABLE, f"{usual.document_mb}"),
        (delivered_file.SETTINGS_VARIABLE, f"{usual.settings_mb}"),
        (delivered_file.ROWS_VARIABLE, f"{usual.rows:,}".replace(",", " ")),
    ):
        (line,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{variable}`")]
        assert line.endswith(f"| {value} |")
