"""What the pages show as Python really comes out of Python."""

from __future__ import annotations

import doctest
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
_FENCE = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def examples(page: Path) -> Iterator[doctest.DocTest]:
    """The interactive examples of a page, one namespace for the whole page."""
    text = page.read_text(encoding="utf-8")
    names: dict[str, object] = {}
    parser = doctest.DocTestParser()
    for match in _FENCE.finditer(text):
        if ">>>" in match[1]:
            line = text[: match.start(1)].count("\n")
            test = parser.get_doctest(match[1], names, page.name, str(page), line)
            # A DocTest copies its names; what one block defines the next one uses.
            test.globs = names
            yield test


def run(page: Path) -> tuple[int, str]:
    """Number of examples of a page, and what differs, in words."""
    differences: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for test in examples(page):
        runner.run(test, out=differences.append, clear_globs=False)
    return runner.tries, "".join(differences)


PAGES = ["conventions.md", "additional-parameters.md", "theory/adjustment.md", "library.md"]


@pytest.mark.parametrize("page", PAGES)
def test_examples_of_a_page_give_what_it_prints(page: str) -> None:
    number, differences = run(DOCS / page)
    assert number > 0
    assert not differences, differences


def test_the_conventions_work_out_the_chain_of_angles_and_frames() -> None:
    """The page may be rewritten; these worked numbers stay on it."""
    text = (DOCS / "conventions.md").read_text(encoding="utf-8")
    for number in ("0.03867", "-2.230355", "-89.747143", "0.755331", "0.646175"):
        assert number in text, number


def test_a_wrong_number_in_a_page_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\n>>> 1 + 1\n3\n\n```\n")
    number, differences = run(page)
    assert number == 1
    assert "Expected" in differences


@pytest.fixture(scope="module")
def example_results(test_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the results of the UltraCam example, as the page on artifacts has them."""
    folder = tmp_path_factory.mktemp("eagle")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_TEST_DATA", str(test_data))
        project = REPOSITORY / "examples" / "ign_ultracam_eagle" / "project.toml"
        outcome = carry_out(aerial_triangulation, RunRequest(project, folder / "results"))
    assert outcome.error is None, outcome.error
    return folder


def test_the_page_on_artifacts_opens_the_results_of_the_example(
    example_results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(example_results)
    number, differences = run(DOCS / "artifacts.md")
    assert number > 0
    assert not differences, differences


def test_every_figure_in_the_summary_of_the_example_is_explained(example_results: Path) -> None:
    summary = json.loads((example_results / "results" / "summary.json").read_text(encoding="utf-8"))
    chapter = (
        (DOCS / "artifacts.md").read_text(encoding="utf-8").split("## summary.json")[1].split("\n## ")[0]
    )
    assert not [name for name in summary if f"`{name}`" not in chapter]
