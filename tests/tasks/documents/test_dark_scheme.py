"""Every page follows the system into the dark, and no text keeps a colour of paper there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

DOCUMENTS = REPOSITORY / "tasks" / "documents"
STYLE = (DOCUMENTS / "report" / "templates" / "style.css").read_text(encoding="utf-8")
SHEETS = sorted([*DOCUMENTS.rglob("*.css"), *DOCUMENTS.rglob("*.j2")])
PAGES = [path for path in SHEETS if "<!DOCTYPE html>" in path.read_text(encoding="utf-8")]
DARK = "@media screen and (prefers-color-scheme: dark) {"
#: Their ground is in the page and light in any scheme.
OWN_GROUND = {".matrix td"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_has_the_shared_style_with_its_dark_scheme(page: Path) -> None:
    assert '{% include "style.css" %}' in page.read_text(encoding="utf-8")
    roots = re.findall(r":root \{([^}]*)\}", STYLE)
    light, dark = (dict(re.findall(r"(--\w+): (#\w+)", root)) for root in roots)
    assert DARK in STYLE
    assert all(light[name] != dark[name] for name in light)


@pytest.mark.parametrize("sheet", SHEETS, ids=lambda sheet: sheet.name)
def test_no_text_has_a_colour_of_paper_in_the_dark(sheet: Path) -> None:
    light, _, dark = sheet.read_text(encoding="utf-8").partition(DARK)
    fixed = {
        rule.strip()
        for rule, css in re.findall(r"([^{}\n]+)\{([^{}]*)\}", light)
        if re.search(r"(?<![-\w])color: #", css) and not rule.strip().startswith("svg")
    }
    assert {rule for rule in fixed if f"{rule} {{ color:" not in dark} <= OWN_GROUND
