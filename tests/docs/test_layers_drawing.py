"""The drawing of the layers in CONTRIBUTING.md is that of pyproject.toml."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.generate.layers import ROOT, with_drawing

PAGE = Path(ROOT, "CONTRIBUTING.md")


def test_the_drawing_is_what_is_enforced() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_drawing(page) == page, "run `python -m docs.generate.layers` and commit CONTRIBUTING.md"


def test_every_folder_and_file_of_the_layers_stands_in_the_drawing() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for storey in ("flows", "tasks"):
        for item in (ROOT / storey).iterdir():
            if item.suffix == ".py" and item.name != "__init__.py":
                assert f" {item.name} " in page
            elif (item / "__init__.py").exists():
                assert f" {item.name}/ " in page


def test_a_page_without_its_marker_lines_is_refused() -> None:
    with pytest.raises(ValueError, match="Drawn by"):
        with_drawing("# Contributing\n")
