"""The command line without a process of its own: its start and its signals are tests of their own."""

from __future__ import annotations

import functools
import os
import subprocess
from pathlib import Path

import typer.testing
from typer.testing import CliRunner

from flows.command.main import app
from flows.runs.workers import DASK_VARIABLE

# Otherwise the tree of all commands is made anew each time.
typer.testing._get_command = functools.cache(typer.testing._get_command)


def aerocal(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Carry out a command; exit code and what it has printed. A defect is raised as it is."""
    words = [*map(str, arguments)]
    # A command with a server or a cluster sets its address for what it starts; the next has its own again.
    addresses = {name: os.environ.get(name) for name in ("PREFECT_API_URL", DASK_VARIABLE)}
    own = {"COLUMNS": "200", **addresses}
    result = CliRunner().invoke(app, words, env={**own, **environment})
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return subprocess.CompletedProcess(words, result.exit_code, result.stdout, result.stderr)
