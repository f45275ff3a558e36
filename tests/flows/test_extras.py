"""A small installation does what it can, and names the extra of what it cannot."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from flows.command.exit_code import EXTRA_OF
from tests.conftest import REPOSITORY
from tests.flows.conftest import write_block

_EXTRAS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]
#: Commands one after the other in a process without the libraries of the extras; what it starts has them.
_SMALL = """\
import json, sys
for name in {missing!r}:
    sys.modules[name] = None
if __name__ == "__main__":
    from typer.testing import CliRunner
    from flows.command.main import app
    for arguments in {commands!r}:
        done = CliRunner().invoke(app, arguments)
        if not isinstance(done.exception, SystemExit | None):
            raise done.exception
        print(json.dumps([done.exit_code, done.stderr]))
"""
#: What needs an extra: arguments, extra.
NEEDING = {
    "serve": (("serve", "--root", "{tmp}", "--state", "{tmp}"), "server"),
    "runner": (("runner",), "server"),
    "notify": (("notify",), "server"),
    "registry": (("registry", "list", "--registry", "postgresql://user@127.0.0.1/none"), "postgresql"),
    "batch": (("batch", "--dask", "tcp://127.0.0.1:1", "{block}"), "cluster"),
}
#: What needs none.
WITHOUT = {command: (command, "{block}/project.toml") for command in ("doctor", "run")}


@dataclass(frozen=True)
class Small:
    """What the commands have ended with in a small installation: exit code and stderr; the adjusted block."""

    block: Path
    ended: dict[str, tuple[int, str]]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Small:
    folder = tmp_path_factory.mktemp("small")
    block = write_block(folder / "block").parent
    commands = {**{name: arguments for name, (arguments, _) in NEEDING.items()}, **WITHOUT}
    made = [[part.format(tmp=folder, block=block) for part in one] for one in commands.values()]
    program = _SMALL.format(missing=sorted(EXTRA_OF), commands=made)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    ended = [json.loads(line) for line in done.stdout.splitlines()]
    return Small(block, {name: (code, said) for name, (code, said) in zip(commands, ended, strict=True)})


def test_every_library_that_an_extra_declares_is_known_by_it() -> None:
    declared = {
        canonicalize_name(Requirement(text).name): extra
        for extra in ("server", "cluster", "postgresql", "images")
        for text in _EXTRAS[extra]
    }
    known = {canonicalize_name(name): extra for name, extra in EXTRA_OF.items()}
    assert declared.items() <= known.items()


def test_a_project_is_checked_and_adjusted_without_any_extra(small: Small) -> None:
    for command in WITHOUT:
        code, said = small.ended[command]
        assert code == 0, said
    assert (small.block / "results" / "report.html").exists()


@pytest.mark.parametrize("command", NEEDING)
def test_what_needs_an_extra_names_it(command: str, small: Small) -> None:
    code, said = small.ended[command]
    assert code == 1
    assert f"pip install 'aerocal[{NEEDING[command][1]}]'" in said
