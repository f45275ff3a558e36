"""The command line without a process of its own: its start and its signals are tests of their own."""

from __future__ import annotations

import functools
import os
import subprocess
from pathlib import Path

import typer.testing
from typer.testing import CliRunner

from flows.command.main import app

# Otherwise the tree of all commands is made anew each time.
typer.testing._get_command = functools.cache(typer.testing._get_command)


def aerocal(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Carry out a command; exit code and what it has printed. A defect is raised as it is."""
    words = [*map(str, arguments)]
    # A command that is given a server sets the address for what it starts; the next one has its own again.
    own = {"COLUMNS": "200", "PREFECT_API_URL": os.environ.get("PREFECT_API_URL")}
    result = CliRunner().invoke(app, words, env={**own, **environment})
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return subprocess.CompletedProcess(words, result.exit_code, result.stdout, result.stderr)
