"""Nothing of ours reads or writes pickles, or carries out text."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

SOURCES = sorted(
    path
    for folder in ("flows", "tasks", "adjust", "benchmarks", "examples", "deploy")
    for path in (REPOSITORY / folder).rglob("*.py")
)
#: Modules whose files carry out code when they are read.
PICKLING = {
    "pickle",
    "_pickle",
    "cPickle",
    "cloudpickle",
    "dill",
    "joblib",
    "shelve",
    "marshal",
    "jsonpickle",
}
METHODS = {"read_pickle", "to_pickle", "unsafe_load", "full_load"}
#: A call on its way to a worker of the same cluster, as Dask itself sends it; nothing of it is stored.
DASK = {"flows/runs/cluster_worker.py"}
TEXT_AS_CODE = {"eval", "exec"}


#: Every text in which something is found has one of them.
WORDS = re.compile(
    rf"{'|'.join(PICKLING | METHODS)}|\b(allow_pickle|shell|{'|'.join(TEXT_AS_CODE)}|os\.[sp])"
)


def found_in(source: str) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            if set(name.split(".")) & PICKLING:
                yield node.lineno, name
        if isinstance(node, ast.Attribute) and node.attr in METHODS:
            yield node.lineno, node.attr
        if isinstance(node, ast.Call):
            called = node.func.id if isinstance(node.func, ast.Name) else ""
            if called in TEXT_AS_CODE:
                yield node.lineno, called
            for keyword in node.keywords:
                if keyword.arg in ("allow_pickle", "shell") and not (
                    isinstance(keyword.value, ast.Constant) and keyword.value.value is False
                ):
                    yield node.lineno, f"{keyword.arg}="
        if (
            isinstance(node, ast.Attribute)
            and node.attr in ("system", "popen")
            and isinstance(node.value, ast.Name)
            and node.value.id == "os"
        ):
            yield node.lineno, f"os.{node.attr}"


def test_no_source_reads_or_writes_pickles_or_carries_out_text() -> None:
    assert len(SOURCES) > 300
    found = [
        f"{path.relative_to(REPOSITORY)}:{line}: {what}"
        for path in SOURCES
        # Most texts have none of the words, and need not be parsed.
        if WORDS.search(text := path.read_text(encoding="utf-8"))
        for line, what in found_in(text)
    ]
    assert {place.partition(":")[0] for place in found} <= DASK, found


@pytest.mark.parametrize(
    "text",
    [
        "import pickle",
        "from joblib import load",
        "import cloudpickle as c",
        "from distributed.protocol import pickle",
        "np.load('x', allow_pickle=True)",
        "pd.read_pickle('x')",
        "eval('1')",
        "import os\nos.system('ls')",
        "subprocess.run('ls', shell=True)",
    ],
)
def test_the_search_finds_what_it_looks_for(text: str) -> None:
    assert WORDS.search(text)
    assert list(found_in(text))


def test_results_of_prefect_are_not_kept() -> None:
    """Prefect would pickle them; every flow says that it does not, and the settings say so for all."""
    for name in ("registered.py", "deployed.py"):
        source = Path(REPOSITORY / "flows" / "serving" / name).read_text(encoding="utf-8")
        flows = [
            call
            for call in ast.walk(ast.parse(source))
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "flow"
        ]
        assert flows
        for call in flows:
            kept = [keyword.value for keyword in call.keywords if keyword.arg == "persist_result"]
            assert [value.value for value in kept if isinstance(value, ast.Constant)] == [False]
