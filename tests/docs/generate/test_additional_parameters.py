from __future__ import annotations

import re
from pathlib import Path

import pytest

from adjust.camera.additional.register import REGISTER
from docs.generate.additional_parameters import additional_parameters_page

PAGE = Path(__file__).resolve().parents[3] / "docs" / "additional-parameters.md"
TEXT = PAGE.read_text(encoding="utf-8")
SECTIONS = {part.split("`")[1]: part for part in re.split(r"^## (?=`)", TEXT, flags=re.MULTILINE)[1:]}


def rows(section: str) -> dict[str, list[str]]:
    """The cells of the table of parameters of a section, by name."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines()]
    return {row[0].strip("`"): row[1:] for row in cells if len(row) == 6 and row[0].startswith("`")}


def test_the_committed_page_is_up_to_date() -> None:
    message = "run `python -m docs.generate.additional_parameters`; commit docs/additional-parameters.md"
    assert additional_parameters_page() == TEXT, message


def test_every_registered_set_has_a_section_and_no_other() -> None:
    assert set(SECTIONS) == {*REGISTER.sets, *(f"{name}(n)" for name in REGISTER.by_degree)}


def test_every_short_form_is_explained() -> None:
    for name, text in REGISTER.presets.items():
        assert f"| `{name}` | `{text}` |" in TEXT


@pytest.mark.parametrize("heading", SECTIONS)
def test_every_parameter_is_listed_with_meaning_unit_status_and_effect(heading: str) -> None:
    family = REGISTER.by_degree.get(heading.partition("(")[0])
    item = REGISTER.sets[heading] if family is None else family.of_degree(family.usual)
    listed = rows(SECTIONS[heading])
    assert list(listed) == [term.name for term in item.terms]
    for term in item.terms:
        meaning, unit, status, value, rms = listed[term.name]
        assert (meaning, unit, status) == (term.meaning, term.unit, term.status)
        assert float(value) > 0.0
        assert 0.0 < float(rms) <= 1.0


def test_published_values_of_the_general_terms_of_bluh_stand_on_the_page() -> None:
    listed = rows(SECTIONS["bluh"])
    published = {
        "1": "1.61e-5",
        "3": "1.92e-5",
        "5": "2.94e-5",
        "8": "1.18e-7",
        "9": "1.60e-9",
        "12": "1.77e-5",
    }
    assert {name: listed[name][3] for name in published} == published
