"""One run at a time in an output folder.

The lock is the operating system's: it ends with the process that holds it, however that ends, so
no stale lock ever has to be removed by hand.
"""

from __future__ import annotations

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasks.storage.installation import writing_into

_log = logging.getLogger("aerocal")


@contextmanager
def run_lock(directory: Path) -> Iterator[None]:
    """Hold the lock of the output folder `directory`, waiting for another run to end if there is one.

    Raises
    ------
    InstallationError
        If the folder cannot be written.
    """
    folder = directory.absolute() / ".store"
    with writing_into(folder):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        _acquire(handle, directory)
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(handle)


def _acquire(handle: int, directory: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        # The number is a hint for the reader only; the lock itself is what counts.
        holder = os.pread(handle, 32, 0).decode(errors="replace").strip() or "unknown"
        _log.warning("another run (process %s) is writing into %s; waiting until it ends", holder, directory)
        fcntl.flock(handle, fcntl.LOCK_EX)
