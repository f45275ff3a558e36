"""The synthetic block with its stages done, for runs whose computing is not what a test is about.

A run that finds every stage stored takes a third of the processor time of one that computes.
"""

from __future__ import annotations

import fcntl
import functools
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from tests.command_line import aerocal
from tests.conftest import SHARED_VARIABLE
from tests.flows.conftest import write_block


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """A folder of this name that the first worker that needs it makes for all."""
    folder = Path(os.environ[SHARED_VARIABLE]) / name
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            made = folder.with_suffix(".made")
            make(made)
            made.rename(folder)
    return folder


def _adjust(folder: Path) -> None:
    done = aerocal("run", write_block(folder), "--server", "none")
    assert done.returncode == 0, done.stderr


@functools.cache
def _adjusted() -> Path:
    return made_once("block", _adjust)


def store_stages(out: Path) -> None:
    """Have a run of the block into this output folder find every stage done."""
    shutil.copytree(_adjusted() / "results" / ".store", out / ".store")


def write_stored_block(folder: Path, *outputs: str) -> Path:
    """Write the block; its runs into these output folders find every stage done, others compute."""
    project = write_block(folder)
    for output in outputs:
        store_stages(folder / output)
    return project
