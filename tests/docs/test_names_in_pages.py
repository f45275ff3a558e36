"""Names of code, files and places that the pages mention exist."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from adjust.parameters import FAMILIES
from tasks.tables.schemas.register import SCHEMAS

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGES = ("adjust", "tasks", "flows")
GENERATED = {"results", "build", "dist"}


def pages() -> Iterator[Path]:
    """All Markdown files of the repository, without those of environments and results."""
    yield from REPOSITORY.glob("*.md")
    for folder in REPOSITORY.iterdir():
        if folder.is_dir() and not folder.name.startswith(".") and folder.name not in GENERATED:
            yield from (path for path in folder.rglob("*.md") if not GENERATED & set(path.parts))


PAGES = sorted(pages())
_FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def prose(page: Path) -> str:
    """The text of a page without its fenced blocks."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def anchors(page: Path) -> set[str]:
    """The places of a page that a link can name: its headings as GitHub spells them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> list[str]:
    """Relative links of a page that lead nowhere."""
    broken = []
    for link in _LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_every_test_that_a_page_names_exists(page: Path) -> None:
    named = re.findall(r"(?<![\w/])tests/[\w/]+(?:\.py)?", page.read_text(encoding="utf-8"))
    assert [name for name in named if not (REPOSITORY / name).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_every_relative_link_leads_somewhere(page: Path) -> None:
    assert broken_links(page) == []


def test_a_broken_link_and_a_missing_heading_are_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# One heading\n[a](page.md#one-heading) [b](nowhere.md) [c](#another) [d](https://e.f)\n"
    )
    assert broken_links(page) == ["nowhere.md", "#another"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_every_file_of_ours_that_a_page_names_exists(page: Path) -> None:
    named = re.findall(rf"`((?:{'|'.join(PACKAGES)}|tests|docs|examples)/[\w./-]+)`", prose(page))
    # NAME stands for a file that is to be written.
    assert [name for name in named if "NAME" not in name and not (REPOSITORY / name).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_every_function_of_ours_that_a_page_names_can_be_imported(page: Path) -> None:
    named = re.findall(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`", prose(page))
    assert [name for name in named if not importable(name)] == []


def importable(name: str) -> bool:
    """Whether a dotted name is a module of ours, or something in one."""
    module, _, attribute = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        pass
    else:
        return True
    try:
        return hasattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError:
        return False


def missing_in_sources(names: set[str]) -> set[str]:
    """Those that are no identifier that our sources define or use, and no table, column or parameter."""
    missing = names - {family.name for family in FAMILIES.values()}
    missing -= {component for family in FAMILIES.values() for component in family.components}
    for schema in SCHEMAS.values():
        missing -= {schema.name, *(column.name for column in schema.columns)}
    for package in PACKAGES:
        for file in (REPOSITORY / package).rglob("*.py"):
            text = file.read_text(encoding="utf-8")
            # Only what contains one of the names has to be parsed.
            if any(name in text for name in missing):
                missing.difference_update(_identifiers(ast.parse(text)))
    return missing


def _identifiers(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


def nomenclature() -> dict[str, list[str]]:
    """Term → names in code, of all tables of the page that have that column."""
    terms: dict[str, list[str]] = {}
    column = False
    for line in prose(REPOSITORY / "docs" / "nomenclature.md").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] in ("term", "here"):
            column = cells[1] == "name in code"
        elif column and line.startswith("|") and not cells[0].startswith("-"):
            terms[cells[0]] = re.findall(r"`(\w+)`", cells[1])
    return terms


def test_every_term_of_the_nomenclature_has_a_name_that_the_sources_know() -> None:
    terms = nomenclature()
    assert len(terms) > 40
    assert [term for term, names in terms.items() if not names] == []
    assert not missing_in_sources({name for names in terms.values() for name in names})


def test_a_name_that_no_source_has_is_noticed() -> None:
    assert missing_in_sources({"extrinsics", "lever_arm", "adjust_block"}) == {"extrinsics"}


def test_every_family_of_parameters_and_observation_group_is_in_the_nomenclature() -> None:
    names = {name for found in nomenclature().values() for name in found}
    for family in FAMILIES.values():
        assert family.name.upper() in names
        assert names & set(family.components), family.name
    for module in sorted((REPOSITORY / "adjust" / "observations").glob("*.py")):
        if module.stem in ("__init__", "base") or module.stem.endswith("_kernel"):
            continue
        classes = [node.name for node in ast.parse(module.read_text()).body if isinstance(node, ast.ClassDef)]
        assert names & set(classes), module.name
