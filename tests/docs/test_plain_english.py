"""Words that a native reader has to read twice do not come back into pages, messages and documents."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]

#: Replaced words, each with what is written instead; see "Terms to use" in docs/nomenclature.md.
REPLACED = {
    r"\blets? expect\b": "expected from",
    r"\b(not|cannot|could not|hardly) (be )?(told|tell)\b": "cannot be separated, identified or determined",
    r"\b(told|tells?)( \w+){0,4} apart\b": "separated, distinguished",
    r"\btells? of\b": "reports, indicates",
    r"\b(limits?|thresholds?) (is|are|was|were) (not )?kept\b": "met, not met",
    r"\bnot kept\b": "not met",
    r"\b(begun|broken off|remarked on)\b": "started; failed, interrupted; reported",
    r"\b(gravest|likeliest)\b": "most serious, most likely",
    r"\b(takes?|took|taking) (no )?part\b": "is used, is not used",
    r"\bcounts? as no\b": "is not used as",
    r"\bis no chance\b": "cannot be due to chance",
    r"\bnothing of (it|that|this|the)\b": "none of",
    r"\bspeaks? of\b": "refers to",
    r"\bin the manner of\b": "following, like",
    r"\bat hand\b": "available",
    r"\banew\b": "again",
    r"\bof one's own\b": "your own",
    r"\b(slips?|mend(s|ed)?)\b": "mistake, correct",
    r"\bis not understood\b": "is not valid",
    r"\bcan(not)? stand (here|in)\b": "is not allowed",
    r"\b(stands?|stood) (in|there|here|on|at|under|beside)\b": "is in, is listed, is given",
    r"\bbeside (the|its|it|them|each|a|an|what|that|this)\b": "next to, in addition to, compared with",
    r"\b(taken as|take the map as|takes? map coordinates as) Cartesian\b": "treated as Cartesian",
    r"\bgoes? on (with|behind|from)\b": "continues",
    r"\b(is|are) asked for\b": "is requested, is required",
    r"\bno positions of the camera\b": "not true camera positions",
    r"\bto be told from\b": "separated from",
    r"\bwhatever (is|its|it|a|the|an|becomes|happens)\b": "anything that, regardless of",
    r"\bby (itself|themselves|of itself)\b": "automatically, separately",
}


def pages() -> Iterator[tuple[str, str]]:
    """Name and text of every page, and of every template of a document."""
    skipped = {"docs/status.md", "docs/nomenclature.md"}
    found = [*REPOSITORY.glob("*.md"), *REPOSITORY.glob("docs/**/*.md"), *REPOSITORY.glob("examples/**/*.md")]
    found += REPOSITORY.glob("benchmarks/*.md")
    found += [
        *REPOSITORY.glob("tasks/**/*.j2"),
        *REPOSITORY.glob("tasks/**/*.typ"),
        *REPOSITORY.glob("deploy/*"),
    ]
    for path in found:
        name = path.relative_to(REPOSITORY).as_posix()
        if path.is_file() and name not in skipped and not name.startswith("docs/api/"):
            yield name, path.read_text(encoding="utf-8")


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Texts of a module, without docstrings: what a user can get to see."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    described = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, described) and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        # A single word is a key or a column.
        if isinstance(node, ast.Constant) and id(node) not in docstrings and " " in str(node.value):
            yield node.lineno, str(node.value)


def said(text: str) -> list[str]:
    """Replaced words of a text, each with its surroundings and with what to write."""
    plain = " ".join(text.split())
    return [
        f"…{plain[max(found.start() - 30, 0) : found.end() + 30]}…: write {instead}"
        for words, instead in REPLACED.items()
        for found in re.finditer(words, plain, re.IGNORECASE)
    ]


@pytest.mark.parametrize("text", [pytest.param(text, id=name) for name, text in pages()])
def test_pages_and_templates_are_free_of_replaced_words(text: str) -> None:
    assert said(text) == []


@pytest.mark.parametrize("package", ["adjust", "tasks", "flows"])
def test_messages_are_free_of_replaced_words(package: str) -> None:
    found = [
        f"{path.relative_to(REPOSITORY)}:{line}: {words}"
        for path in sorted((REPOSITORY / package).rglob("*.py"))
        for line, text in messages(path)
        for words in said(text)
    ]
    assert found == []


@pytest.mark.parametrize("text", ["a lever arm that cannot be\ntold from a shift", "Nothing of it is used."])
def test_replaced_words_are_found(text: str) -> None:
    assert len(said(text)) == 1
