"""The notebook has the examples of the page on the library, with the outputs of this version."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from docs.generate.notebook import NOTEBOOK, notebook

KEPT: dict[str, Any] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))


def outputs(document: dict[str, Any]) -> list[dict[str, Any]]:
    return [output for cell in document["cells"] for output in cell.get("outputs", [])]


def flat(value: Any) -> list[Any]:
    """All texts and numbers of a tree, in order."""
    if isinstance(value, dict):
        return [part for key, one in value.items() for part in (key, *flat(one))]
    return [part for one in value for part in flat(one)] if isinstance(value, list) else [value]


@pytest.fixture(scope="module")
def executed() -> dict[str, Any]:
    return json.loads(json.dumps(notebook()))


def test_the_notebook_is_that_of_this_version(executed: dict[str, Any]) -> None:
    found, kept = flat(executed), flat(KEPT)
    assert len(found) == len(kept), "run python -m docs.generate.notebook"
    for one, other in zip(found, kept, strict=True):
        if isinstance(one, float):
            assert one == pytest.approx(other, abs=2e-4), "run python -m docs.generate.notebook"
        else:
            assert one == other, "run python -m docs.generate.notebook"


def test_it_shows_tables_a_picture_and_an_error_in_words() -> None:
    kinds = [kind for output in outputs(KEPT) for kind in output.get("data", {})]
    assert {"text/html", "application/vnd.plotly.v1+json"} <= set(kinds)
    (error,) = [output for output in outputs(KEPT) if output["output_type"] == "error"]
    assert error["ename"] == "UnknownNameError"


def test_it_is_a_notebook_of_format_4() -> None:
    assert (KEPT["nbformat"], KEPT["nbformat_minor"]) == (4, 5)
    names = [cell["id"] for cell in KEPT["cells"]]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"[a-zA-Z0-9_-]{1,64}", name) for name in names)
    common = {"id", "cell_type", "metadata", "source"}
    for cell in KEPT["cells"]:
        code = {"outputs", "execution_count"} if cell["cell_type"] == "code" else set()
        assert set(cell) == common | code
