"""The command line without a process of its own: its start and its signals are tests of their own."""

from __future__ import annotations

import functools
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
    result = CliRunner().invoke(app, words, env={"COLUMNS": "200", **environment})
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return subprocess.CompletedProcess(words, result.exit_code, result.stdout, result.stderr)
