"""Modules that lie in a delivery are data: no program of ours takes them for its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

#: Modules that everything imports sooner or later.
PLANTED = ("calendar", "json", "random", "multiprocessing", "tasks", "numpy", "typer")


def plant(folder: Path) -> Path:
    """Put modules into a folder that leave a trace when they are imported; where they leave it."""
    traces = folder.parent / "traces"
    traces.mkdir(exist_ok=True)
    for name in PLANTED:
        trace = f"import os\nopen(f'{traces}/{name}-{{os.getpid()}}', 'w').close()\n"
        (folder / f"{name}.py").write_text(trace)
    return traces


def test_commands_and_their_workers_import_nothing_from_the_folder_they_are_started_in(
    tmp_path: Path, run_before: Path
) -> None:
    root = tmp_path / "root"
    for name in "ab":
        # Where modules are looked for is settled before a worker computes anything.
        shutil.copytree(run_before, root / name)
    traces = plant(root)
    console = str(Path(sys.executable).with_name("aerocal"))
    for program in (
        [console, "batch", "a", "b", "--workers", "2"],
        [sys.executable, "-m", "flows.command", "export"],
    ):
        done = subprocess.run(
            program,
            cwd=root,
            env={name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"},
            capture_output=True,
            text=True,
            check=False,
            timeout=280,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert list(traces.iterdir()) == [], program
