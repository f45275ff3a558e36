"""Draw the layers in CONTRIBUTING.md from pyproject.toml: ``python -m docs.generate.layers``.

The drawing is what import-linter enforces: a folder or file imports only what stands below it. The words are
the first sentences of the folders' and files' docstrings. A test compares the committed page.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BEGIN = "<!-- Drawn by python -m docs.generate.layers from pyproject.toml. -->"
END = "<!-- End of the drawing. -->"
_STOREYS = "Three storeys: imports point downwards only"


def with_drawing(page: str) -> str:
    """The page with what stands between the two marker lines drawn again.

    Raises
    ------
    ValueError
        If the page lacks a marker line.
    """
    head, begin, rest = page.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page lacks the line {END if begin else BEGIN}")
    return f"{head}{BEGIN}\n\n```\n{chr(10).join(_drawing())}\n```\n\n{END}{tail}"


def _drawing() -> Iterator[str]:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layered = [item for item in contracts["contracts"] if item["type"] == "layers"]
    (storeys,) = (item for item in layered if item["name"] == _STOREYS)
    rooms = {item["containers"][0]: item for item in layered if "containers" in item}
    for number, storey in enumerate(storeys["layers"]):
        if number:
            yield ""
        yield f"{storey}/"
        if storey in rooms:
            yield from _floors(storey, rooms[storey])


def _floors(storey: str, contract: dict[str, Any]) -> Iterator[str]:
    """A line for each folder or file; those of one floor, which do not import each other, share a bracket."""
    floors = [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]
    width = max(len(name) for floor in floors for name in floor) + 1
    for floor in floors:
        for number, name in enumerate(sorted(floor)):
            edge = "─" if len(floor) == 1 else "┌" if number == 0 else "└" if name == max(floor) else "│"
            path = ROOT / storey / name
            label = f"{name}/" if path.is_dir() else f"{name}.py"
            yield f"  {edge} {label:{width + 2}} {_first_sentence(path)}".rstrip()


def _first_sentence(path: Path) -> str:
    """Of the docstring of a folder or file."""
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    said = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return said.split("\n\n")[0].replace("\n", " ").removesuffix(".")


def main() -> None:
    """Draw again."""
    page = ROOT / "CONTRIBUTING.md"
    page.write_text(with_drawing(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
