"""The gallery shows what the program prints and draws: its commands are carried out here."""

from __future__ import annotations

import contextlib
import re
import xml.etree.ElementTree as ET
from itertools import zip_longest
from pathlib import Path

import pytest

from docs.generate.gallery import KEPT, PAGE, carry_out, pictures, printed
from tests.command_line import aerocal
from tests.docs.test_examples_in_pages import run

# All kernels may have to be compiled before.
pytestmark = pytest.mark.timeout(600)

_NUMBER = re.compile(r"(?<![#\w.])-?\d+(?:\.\d+)?")
#: Coordinates are written in tenths of a unit; another processor may round one of them the other way.
_ROUNDING = 0.1001


def difference(found: Path, kept: Path) -> str:
    """First element in which two drawings differ; empty if there is none."""
    for one, other in zip_longest(ET.parse(found).iter(), ET.parse(kept).iter()):
        if one is None or other is None:
            return "another number of elements"
        of_both = [[element.tag, element.text or "", *sorted(element.items())] for element in (one, other)]
        texts = ["\n".join(map(str, parts)) for parts in of_both]
        numbers = [[float(number) for number in _NUMBER.findall(text)] for text in texts]
        drawn = [_NUMBER.sub("0", text) for text in texts]
        if drawn[0] != drawn[1] or numbers[0] != pytest.approx(numbers[1], abs=_ROUNDING, rel=0):
            return " and ".join(texts)
    return ""


@pytest.fixture(scope="module")
def carried_out(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, Path]:
    place = tmp_path_factory.mktemp("gallery")
    return place, *carry_out(place, in_process)


def in_process(arguments: list[str], place: Path) -> str:
    with contextlib.chdir(place):
        done = aerocal(*arguments, COLUMNS="80")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_picture_of_the_page_is_kept_and_none_is_left_over() -> None:
    assert pictures()
    assert sorted(path.name for path in KEPT.iterdir()) == sorted(pictures())


def test_the_page_shows_every_figure_as_it_is_drawn(carried_out: tuple[Path, str, Path]) -> None:
    _, _, figures = carried_out
    assert sorted(path.name for path in figures.iterdir()) == sorted(pictures())
    differences = {name: difference(figures / name, KEPT / name) for name in pictures()}
    assert not any(differences.values()), f"run python -m docs.generate.gallery: {differences}"


def test_the_page_shows_what_the_adjustment_prints(carried_out: tuple[Path, str, Path]) -> None:
    _, shown, _ = carried_out
    assert printed(PAGE.read_text(encoding="utf-8")) == shown, "run python -m docs.generate.gallery"


def test_the_examples_of_the_page_give_what_it_prints(
    carried_out: tuple[Path, str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(carried_out[0])
    number, differences = run(PAGE)
    assert number > 2
    assert not differences, differences


def test_another_drawing_is_noticed(tmp_path: Path) -> None:
    drawing = (KEPT / "histogram.svg").read_text(encoding="utf-8")
    other = tmp_path / "other.svg"
    for changed in (drawing.replace("</text>", "!</text>", 1), re.sub(r'x1="\d', 'x1="1', drawing, count=1)):
        other.write_text(changed, encoding="utf-8")
        assert difference(other, KEPT / "histogram.svg")
    other.write_text(drawing, encoding="utf-8")
    assert not difference(other, KEPT / "histogram.svg")
