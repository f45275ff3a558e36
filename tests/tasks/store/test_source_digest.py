"""The digest of the source: a change anywhere behind a function is seen, a change elsewhere is not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tasks.store.store
from tasks.store.source_digest import sources_reached

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A small application of the same three packages around the real digest."""
    files = {
        "flows/__init__.py": "",
        "tasks/__init__.py": "",
        "tasks/store/__init__.py": "",
        "tasks/store/source_digest.py": (REPOSITORY / "tasks/store/source_digest.py").read_text(),
        "tasks/estimate.py": (
            "from adjust.solve.iterate import iterate\nfrom adjust import camera\n"
            "def estimate():\n    from tasks.lazily import late\n    return iterate(), late(), camera\n"
        ),
        "tasks/lazily.py": "import importlib\ndef late():\n    importlib.import_module('tasks.named')\n",
        "tasks/named.py": "",
        "tasks/report.py": "from tasks.estimate import estimate\n",
        "tasks/py.typed": "",
        "adjust/solve/templates/sections/words.html": "",
        "adjust/__init__.py": "'''A package.'''\nfrom .register import names\n",
        "adjust/register.py": "names = ()\n",
        "adjust/camera/__init__.py": "from . import frame\n",
        "adjust/camera/frame.py": "",
        "adjust/solve/__init__.py": "from adjust.solve.unused import nothing\n",
        "adjust/solve/unused.py": "nothing = None\n",
        "adjust/solve/iterate.py": "from .step_kernel import step\ndef iterate():\n    return step()\n",
        "adjust/solve/step_kernel.py": "from ..callee import callee\ndef step():\n    return callee()\n",
        "adjust/callee.py": "def callee():\n    return 1\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def digest(tree: Path) -> str:
    program = (
        "from tasks.estimate import estimate; from tasks.store.source_digest import digest_of_sources; "
        "print(digest_of_sources(estimate))"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", program],
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "changed",
    [
        "tasks/estimate.py",
        "tasks/lazily.py",  # imported inside a function
        "tasks/named.py",  # imported by its name as text
        "tasks/__init__.py",  # runs whenever a module of the package is imported
        "adjust/__init__.py",
        "adjust/solve/__init__.py",
        "adjust/solve/iterate.py",
        "adjust/solve/step_kernel.py",
        "adjust/callee.py",  # what a kernel calls
        "adjust/camera/frame.py",  # behind a package that is imported itself
        "adjust/solve/templates/sections/words.html",  # a template beside a module
    ],
)
def test_a_change_behind_the_function_changes_the_digest(tree: Path, changed: str) -> None:
    before = digest(tree)
    with (tree / changed).open("a") as stream:
        stream.write("# a remark\n")
    assert digest(tree) != before


def test_a_change_elsewhere_leaves_the_digest(tree: Path) -> None:
    before = digest(tree)
    others = ("tasks/report.py", "adjust/solve/unused.py", "adjust/register.py", "flows/__init__.py")
    for unrelated in (*others, "tasks/py.typed"):
        with (tree / unrelated).open("a") as stream:
            stream.write("# a remark\n")
    assert digest(tree) == before


def test_the_digest_does_not_depend_on_where_the_application_lies(tree: Path, tmp_path: Path) -> None:
    before = digest(tree)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for package in ("flows", "tasks", "adjust"):
        (tree / package).rename(elsewhere / package)
    assert digest(elsewhere) == before


def test_an_import_whose_name_is_computed_counts_as_importing_everything(tree: Path) -> None:
    with (tree / "tasks/lazily.py").open("a") as stream:
        stream.write("def any_of(name):\n    return importlib.import_module(name)\n")
    before = digest(tree)
    with (tree / "tasks/report.py").open("a") as stream:
        stream.write("# a remark\n")
    assert digest(tree) != before


def test_the_store_itself_reaches_the_digest_and_the_key() -> None:
    reached = sources_reached(Path(tasks.store.store.__file__))
    assert {
        "tasks/store/store.py",
        "tasks/store/stage_key.py",
        "tasks/store/source_digest.py",
        "tasks/store/artifact.py",
    } <= set(reached)
    # Of what computes only the list of extensions, whose sources are part of every key.
    computing = {name for name in reached if name.startswith(("flows/", "adjust/"))}
    assert computing == {"adjust/__init__.py", "adjust/errors.py", "adjust/extensions.py"}
