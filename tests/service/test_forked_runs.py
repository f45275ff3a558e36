"""Processes of runs that are forked: what is loaded before, and what was changed since."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.service

_CARRY_OUT = """
import threading
from flows.serving import preload
from flows.serving.fork import _carry_out
from adjust.extensions import installed_extensions
from tasks.store.stage_key import library_versions

if __name__ == "__main__":
    # Another thread may hold a lock that nobody would release in a forked process.
    assert threading.active_count() == 1
    # Each run asks for them itself.
    assert not installed_extensions.cache_info().currsize + library_versions.cache_info().currsize
    {change}
    _carry_out({{"PREFECT__FLOW_RUN_ID": "none"}}, "/")
"""


def _carried_out(folder: Path, change: str) -> str:
    """What the process of a run without identity says."""
    program = folder / "program.py"
    program.write_text(_CARRY_OUT.format(change=change))
    variables = {
        **os.environ,
        "PREFECT_HOME": str(folder / "prefect"),
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, check=False, env=variables
    )
    assert "badly formed hexadecimal UUID" in done.stderr
    return done.stderr


def test_what_is_loaded_is_used_as_long_as_nothing_is_installed(tmp_path: Path) -> None:
    assert "runpy" not in _carried_out(tmp_path, "")


def test_after_an_installation_a_run_loads_its_program_again(tmp_path: Path) -> None:
    assert "runpy" in _carried_out(tmp_path, "preload.LOADED = ('another version',)")
