"""One run at a time in an output folder.

The lock is the operating system's: it ends with the process that holds it, however that ends, so
no stale lock ever has to be removed by hand.

It also holds the folder in place: a link that somebody puts there, or in the folder of finished stages,
would lead a run to write where it may not. What is opened here is looked at after it has been opened, so that
nothing can come between the look and the use; before results are published the folder must still be the one
that was locked.
"""

from __future__ import annotations

import fcntl
import logging
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tasks.errors import InputError, Location
from tasks.files.installation import InstallationError, writing_into

_log = logging.getLogger("aerocal")

#: How often it is looked whether a lock is free, s.
_LOOK_S = 0.2

#: By output folder, the lock that this process holds.
_HELD: dict[Path, int] = {}


@contextmanager
def run_lock(directory: Path, roots: Sequence[Path] = ()) -> Iterator[None]:
    """Hold the lock of the output folder `directory`, waiting for another run to end if there is one.

    Parameters
    ----------
    roots : folders, links resolved, one of which it must lie under (runs of a deployment); empty: anywhere.

    Raises
    ------
    InputError
        If it does not, or there are links in the folder of finished stages.
    InstallationError
        If the folder cannot be written.
    """
    folder = directory.absolute() / ".store"
    with writing_into(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with _opened(directory, roots) as handle:
        if not lock_if_free(handle):
            # The number is a hint for the reader only; the lock itself is what counts.
            holder = os.pread(handle, 32, 0).decode(errors="replace").strip() or "unknown"
            _log.warning(
                "another run (process %s) is writing into %s; waiting for it to finish", holder, directory
            )
            # Not in the system call: a signal that comes just before it would be heard of only after it.
            while not lock_if_free(handle):
                time.sleep(_LOOK_S)
        _take(handle, directory)
        yield


@contextmanager
def run_lock_if_free(directory: Path, roots: Sequence[Path] = ()) -> Iterator[bool]:
    """Hold the lock of an existing output folder if it is free; yields whether it is held.

    Parameters and errors as of `run_lock`.
    """
    with _opened(directory, roots) as handle:
        held = lock_if_free(handle)
        if held:
            _take(handle, directory)
        yield held


@contextmanager
def _opened(directory: Path, roots: Sequence[Path]) -> Iterator[int]:
    """The file of the lock, inside the folders the run is confined to."""
    folder = directory.absolute() / ".store"
    with writing_into(folder):
        handle = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    try:
        _require_inside(handle, directory, roots)
        yield handle
    finally:
        if _HELD.get(directory.absolute()) == handle:
            del _HELD[directory.absolute()]
        os.close(handle)


def lock_if_free(handle: int) -> bool:
    """Lock the file if it is free; returns whether it is locked now."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _take(handle: int, directory: Path) -> None:
    """Take the folder, and record its holder."""
    _require_no_links(directory.absolute() / ".store")
    os.ftruncate(handle, 0)
    os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
    _HELD[directory.absolute()] = handle


def require_in_place(directory: Path) -> None:
    """Make sure that an output folder this process has locked is still the one at its path.

    Raises
    ------
    InstallationError
        If it was moved, removed or replaced since.
    """
    handle = _HELD.get(directory.absolute())
    if handle is None:
        return
    try:
        status = (directory.absolute() / ".store" / "lock").stat(follow_symlinks=False)
        if os.path.samestat(status, os.fstat(handle)):
            return
    except OSError:
        # Gone: not in place either.
        pass
    raise InstallationError(
        f"The output folder {directory} was moved or replaced while a run was writing into it.",
        "Leave it alone until the run has ended, then run again.",
    )


def _require_inside(handle: int, directory: Path, roots: Sequence[Path]) -> None:
    """Refuse a lock that was opened outside the folders the run is confined to."""
    if not roots:
        return
    place = (directory / ".store" / "lock").resolve()
    inside = any(place.is_relative_to(root) for root in roots)
    if not inside or not os.path.samestat(place.stat(), os.fstat(handle)):
        raise InputError(
            f"The output folder {directory} leads outside the folders of this server.", "Remove the link."
        )


def _require_no_links(folder: Path) -> None:
    for at, folders, files in os.walk(folder):
        for name in (*folders, *files):
            if (Path(at) / name).is_symlink():
                raise Location(Path(at) / name).error(
                    "There is a link in the folder of finished stages.",
                    "Remove it, or choose another output folder.",
                )
