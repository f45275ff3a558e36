"""Names that differ between files of a delivery are paired with what they may be."""

from __future__ import annotations

import pytest

from tasks.plausibility.coverage import spelled_otherwise


@pytest.mark.parametrize(
    ("missing", "known"),
    [("P-007", "p7"), ("1001.0", "1001"), ("M\u00fc 1", "Mu\u0308 1"), ("M 1", "M\u00a01"), (" 12", "12")],
)
def test_names_are_the_same_but_for_their_spelling(missing: str, known: str) -> None:
    sentence = spelled_otherwise([missing], ["other", known])
    assert f"'{missing}' may be '{known}'" in sentence


def test_names_that_look_the_same_are_told_apart_by_their_characters() -> None:
    sentence = spelled_otherwise(["M\u00fc1"], ["Mu\u0308\u0031"])
    assert sentence.endswith("write them with the same (of accents, the Unicode form NFC).")
    assert r"'M\xfc1' and 'Mu\u03081'" in sentence


@pytest.mark.parametrize(("missing", "known"), [("P1", "P2"), ("P10", "P1")])
def test_other_names_are_not(missing: str, known: str) -> None:
    assert spelled_otherwise([missing], [known]) == ""
