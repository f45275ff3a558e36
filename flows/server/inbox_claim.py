"""An inbox belongs to one server: with records of its own, a second one would run every delivery again."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasks.files.installation import InstallationError
from tasks.files.machine import machine
from tasks.store.run_lock import lock_if_free

#: How long a server that is ending is waited for, s.
_LOOK_S = 2.0
_CLAIM = ".aerocal.lock"


@contextmanager
def claimed(inbox: Path | None) -> Iterator[None]:
    """Hold an inbox while the context lasts, if there is one.

    The lock is the operating system's and ends with the process. An inbox in which nothing can be written, or
    whose file system has no locks, is not held.

    Raises
    ------
    InstallationError
        If another server holds it.
    """
    handle = None if inbox is None else _opened(inbox)
    if inbox is None or handle is None:
        yield
        return
    try:
        _hold(handle, inbox)
        yield
    finally:
        os.close(handle)


def _opened(inbox: Path) -> int | None:
    try:
        return os.open(inbox / _CLAIM, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError:
        return None


def _hold(handle: int, inbox: Path) -> None:
    until = time.monotonic() + _LOOK_S
    try:
        while not lock_if_free(handle):
            if time.monotonic() > until:
                holder = os.pread(handle, 200, 0).decode(errors="replace").strip() or "unknown"
                raise InstallationError(
                    f"Another server takes its deliveries from the inbox {inbox} ({holder}).",
                    "Stop it first, or give this one another --inbox. More runs at the same time: --limit, "
                    "aerocal runner.",
                )
            time.sleep(0.02)
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{machine()}, process {os.getpid()}\n".encode(), 0)
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP):
            raise
