"""The examples of docs/library.md as a notebook with its outputs: ``python -m docs.generate.notebook``.

The notebook is docs/library.ipynb (format 4.5 of Jupyter). Seeds are fixed: tests compare it with a new run.
"""

from __future__ import annotations

import ast
import base64
import doctest
import json
import re
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).resolve().parents[1] / "library.md"
NOTEBOOK = PAGE.with_suffix(".ipynb")
_FENCE = re.compile(r"^```python\n(>>> .*?)^```$", re.DOTALL | re.MULTILINE)
#: The last chapter with examples is before this heading.
_END = "\n## Your own observations"
#: Decimals of the numbers in a picture: metres and millimetres on the screen need no more.
_DECIMALS = 4


def cells() -> Iterator[dict[str, Any]]:
    """Cells of the notebook: texts of the page, and its examples with what they give."""
    text = PAGE.read_text(encoding="utf-8").split(_END)[0]
    names: dict[str, Any] = {"__name__": "__main__"}
    parts = _FENCE.split(text)
    for number, part in enumerate(parts):
        if number % 2 == 0:
            yield {"cell_type": "markdown", "metadata": {}, "source": _lines(part.strip())}
            continue
        source = ""
        for example in doctest.DocTestParser().get_examples(part):
            source += example.source
            if example.want:
                yield _executed(source, names)
                source = ""
        if source:
            yield _executed(source, names)


def _executed(source: str, names: dict[str, Any]) -> dict[str, Any]:
    """A cell of code with its output, as Jupyter shows the value of its last expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    outputs: list[dict[str, Any]] = []
    try:
        exec(compile(tree, str(PAGE), "exec"), names)
        value = None if last is None else eval(compile(ast.Expression(last.value), str(PAGE), "eval"), names)
        if value is not None:
            outputs.append({"output_type": "execute_result", "metadata": {}, "data": _data(value)})
    except Exception as error:
        words = traceback.format_exception_only(error)
        outputs.append(
            {"output_type": "error", "ename": type(error).__name__, "evalue": str(error), "traceback": words}
        )
    for output in outputs:
        if output["output_type"] == "execute_result":
            output["execution_count"] = None
    code = _lines(source.strip())
    return {"cell_type": "code", "metadata": {}, "execution_count": None, "source": code, "outputs": outputs}


def _data(value: Any) -> dict[str, Any]:
    """A value as text and, if it has one, as a page or a picture."""
    if hasattr(value, "to_plotly_json"):
        return {
            "application/vnd.plotly.v1+json": _rounded(json.loads(value.to_json())),
            "text/plain": ["Figure"],
        }
    page = value._repr_html_() if hasattr(value, "_repr_html_") else None
    return {**({"text/html": _lines(page)} if page else {}), "text/plain": _lines(repr(value))}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict) and "bdata" in value:
        # Plotly packs arrays as bytes, whose last digits differ from one kind of processor to the next.
        return _rounded(np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"]).tolist())
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return round(value, _DECIMALS) if isinstance(value, float) else value


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def notebook() -> dict[str, Any]:
    """The notebook, executed."""
    numbered = [{"id": f"cell-{number}", **cell} for number, cell in enumerate(cells(), start=1)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    about = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": numbered, "metadata": about, "nbformat": 4, "nbformat_minor": 5}


def main() -> int:
    """Execute the examples and write the notebook."""
    NOTEBOOK.write_text(json.dumps(notebook(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
