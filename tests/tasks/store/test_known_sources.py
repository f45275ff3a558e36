"""What is remembered of the sources is served only while every file is as it was."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[3]
_OURS = (
    "adjust/errors.py",
    "adjust/extensions.py",
    "tasks/errors.py",
    "tasks/magnitude.py",
    "tasks/store/known_sources.py",
    "tasks/store/source_digest.py",
    "tasks/files/json_text.py",
    "tasks/plain_text.py",
)
_FALSE = "0" * 64


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A small application of the same three packages around the real digests."""
    files = {name: (REPOSITORY / name).read_text() for name in _OURS} | {
        "flows/__init__.py": "",
        "tasks/__init__.py": "",
        "tasks/store/__init__.py": "",
        "tasks/estimate.py": "from adjust.iterate import iterate\ndef estimate():\n    return iterate()\n",
        "tasks/documents/report.py": "",
        "adjust/__init__.py": "",
        "adjust/iterate.py": "def iterate():\n    return 1\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def digest(tree: Path, settled_ns: int = -1) -> str:
    program = (
        f"import tasks.store.known_sources as known; known._SETTLED_NS = {settled_ns}; "
        "from tasks.estimate import estimate; print(known.known_digest_of_sources(estimate))"
    )
    path = os.pathsep.join((str(tree), *(folder for folder in sys.path if "site-packages" in folder)))
    environment = {**os.environ, "AEROCAL_SOURCES_CACHE": str(tree / "cache"), "PYTHONPATH": path}
    # Without site nothing of the installed application is found in place of what the tree lacks.
    done = subprocess.run(
        [sys.executable, "-S", "-c", program],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def falsify(tree: Path) -> None:
    """Put another digest into what is remembered: whoever serves it has not read the sources."""
    (place,) = (tree / "cache").glob("*.json")
    content = json.loads(place.read_text())
    place.write_text(json.dumps({**content, "digests": {"tasks/estimate.py": _FALSE}}))


def test_unchanged_sources_are_not_read_again(tree: Path) -> None:
    digest(tree)
    falsify(tree)
    assert digest(tree) == _FALSE


def test_a_change_that_leaves_size_and_time_is_seen(tree: Path) -> None:
    before = digest(tree)
    callee = tree / "adjust/iterate.py"
    status = callee.stat()
    callee.write_text(callee.read_text().replace("1", "2"))
    os.utime(callee, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert digest(tree) not in (before, _FALSE)


def test_a_new_file_anywhere_ends_what_is_remembered(tree: Path) -> None:
    digest(tree)
    for name in ("adjust/more/__init__.py", "tasks/later.py", "flows/words.html"):
        falsify(tree)
        (tree / name).parent.mkdir(exist_ok=True)
        (tree / name).write_text("")
        assert digest(tree) != _FALSE


def test_what_python_has_compiled_is_no_change(tree: Path) -> None:
    digest(tree)
    falsify(tree)
    (tree / "adjust/__pycache__").mkdir(exist_ok=True)
    (tree / "adjust/__pycache__/iterate.cpython-300.pyc").write_text("")
    assert digest(tree) == _FALSE


def test_sources_that_have_just_been_written_are_not_remembered(tree: Path) -> None:
    digest(tree, settled_ns=10**18)
    assert not (tree / "cache").exists()


def test_a_damaged_memory_is_made_anew(tree: Path) -> None:
    before = digest(tree)
    (place,) = (tree / "cache").glob("*.json")
    sound = place.read_text()
    for content in ("", "[]", '{"listing": 1}', "{"):
        place.write_text(content)
        assert digest(tree) == before
        assert place.read_text() == sound
    falsify(tree)
    assert digest(tree) == _FALSE


def test_a_folder_that_cannot_be_written_changes_nothing(tree: Path) -> None:
    before = digest(tree)
    for file in (tree / "cache").iterdir():
        file.unlink()
    (tree / "cache").rmdir()
    (tree / "cache").write_text("occupied")
    assert digest(tree) == before
