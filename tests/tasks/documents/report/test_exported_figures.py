"""Which files the figures of a report replace when they are written again."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from tasks.documents.report.export import export_figures
from tasks.errors import InputError

PAGE = (
    "<style>svg text { fill: red }</style>"
    '<figure id="figure-block"><svg viewBox="0 0 10 10"><text>{0}</text></svg></figure>'
    '<figure id="figure-map"><svg viewBox="0 0 10 10"><text>{0}</text></svg></figure>'
)


def exported(tmp_path: Path, text: str) -> Path:
    report = tmp_path / "report.html"
    report.write_text(PAGE.replace("{0}", text))
    first, _ = export_figures(report, tmp_path / "figures")
    assert ElementTree.parse(first).getroot().tag.endswith("svg")
    return first


def test_figures_are_written_again(tmp_path: Path) -> None:
    exported(tmp_path, "σ0 1.0")
    assert "σ0 2.0" in exported(tmp_path, "σ0 2.0").read_text(encoding="utf-8")


@pytest.mark.parametrize("edited", [True, False])
def test_drawings_of_somebody_else_and_edited_ones_stay(tmp_path: Path, edited: bool) -> None:
    figure = exported(tmp_path, "1.0").with_name("map.svg")
    own = figure.read_text().replace("red", "blue") if edited else "<svg/>"
    figure.write_text(own)
    with pytest.raises(InputError, match=r"map.svg: .* not by aerocal or was changed since"):
        exported(tmp_path, "2.0")
    assert figure.read_text() == own
    assert "1.0" in figure.with_name("block.svg").read_text()
