"""The register of numbers names statements, commands and tests that exist."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
_ROW = re.compile(r"^\| (\S+\.(?:md|ipynb)) \| (.+) \| (.+) \| (.+) \|$", re.MULTILINE)


@dataclass(frozen=True)
class Entry:
    """A row of the register."""

    page: str
    statements: tuple[str, ...]
    command: str
    tests: tuple[str, ...]

    def missing(self) -> list[str]:
        """What the row names and what does not exist."""
        page = " ".join((REPOSITORY / self.page).read_text(encoding="utf-8").split())
        absent = [statement for statement in self.statements if statement not in page]
        absent += [test for test in self.tests if not (REPOSITORY / test).is_file()]
        if module := re.fullmatch(r"`python -m ([\w.]+)`", self.command):
            path = Path(*module[1].split(".")).with_suffix(".py")
            absent += [] if (REPOSITORY / path).is_file() else [module[1]]
        elif self.command != "by hand":
            absent.append(self.command)
        return absent


def entries(text: str) -> list[Entry]:
    return [
        Entry(
            page, tuple(re.findall("“(.+?)”", numbers)), command, tuple(re.findall(r"`(tests/\S+)`", tests))
        )
        for page, numbers, command, tests in _ROW.findall(text)
    ]


REGISTER = entries((REPOSITORY / "docs" / "numbers.md").read_text(encoding="utf-8"))


def test_the_register_is_read() -> None:
    assert len(REGISTER) > 15
    assert all(entry.statements and entry.tests for entry in REGISTER)


@pytest.mark.parametrize("entry", REGISTER, ids=lambda entry: entry.page)
def test_statement_command_and_test_exist(entry: Entry) -> None:
    assert entry.missing() == []


def test_what_does_not_exist_is_named() -> None:
    row = "| README.md | “13 wrong numbers” | `python -m docs.generate.none` | `tests/docs/test_none.py` |"
    (entry,) = entries(row)
    assert entry.missing() == ["13 wrong numbers", "tests/docs/test_none.py", "docs.generate.none"]
