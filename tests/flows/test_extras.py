"""A small installation does what it can, and names the extra of what it cannot."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from flows.command.extras import EXTRA_OF
from tests.conftest import REPOSITORY

_EXTRAS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]
#: A process without the libraries of the extras; what it starts is not without them.
_SMALL = """\
import sys
for name in {missing!r}:
    sys.modules[name] = None
if __name__ == "__main__":
    from flows.command.main import app
    app({arguments!r})
"""


def small(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """A command in a process that cannot import any library of an extra."""
    program = _SMALL.format(missing=sorted(EXTRA_OF), arguments=[*map(str, arguments)])
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)


def test_every_library_that_an_extra_declares_is_known_by_it() -> None:
    declared = {
        canonicalize_name(Requirement(text).name): extra
        for extra in ("server", "cluster", "postgresql", "images")
        for text in _EXTRAS[extra]
    }
    known = {canonicalize_name(name): extra for name, extra in EXTRA_OF.items()}
    assert declared.items() <= known.items()


@pytest.mark.parametrize("command", ["doctor", "run"])
def test_a_project_is_checked_and_adjusted_without_any_extra(command: str, block: Path) -> None:
    done = small(command, block)
    assert done.returncode == 0, done.stderr
    assert command == "doctor" or (block.parent / "results" / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (("serve",), "server"),
        (("runner",), "server"),
        (("notify",), "server"),
        (("registry", "list", "--registry", "postgresql://user@127.0.0.1/none"), "postgresql"),
        (("batch", "--dask", "tcp://127.0.0.1:1"), "cluster"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_what_needs_an_extra_names_it(
    arguments: tuple[str, ...], extra: str, block: Path, tmp_path: Path
) -> None:
    further = {"serve": ("--root", tmp_path, "--state", tmp_path), "batch": (block.parent,)}
    done = small(*arguments, *further.get(arguments[0], ()))
    assert done.returncode == 1
    assert f"pip install 'aerocal[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr
