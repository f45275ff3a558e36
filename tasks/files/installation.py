"""What is wrong with the place a run happens in: a full disk, a folder that cannot be written.

Neither the input nor the adjustment is to blame, so the command line ends with exit code 1.
"""

from __future__ import annotations

import errno
import os
import re
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import AerocalError
from tasks.files.machine import machine
from tasks.plain_text import visible

_SHOWN = 500
#: Names of unfinished files: of which machine, which process, and which file.
_PART = re.compile(r"(\.aerocal\.[A-Za-z0-9-]{1,64}\.)(\d{1,9})\.[0-9a-f]{8}\.part(\.\w+)*")
#: Who writes a file writes something into it at least this often, s: no file takes a day as a whole.
_STILL_S = 86_400.0
_FULL = {errno.ENOSPC, errno.EDQUOT}
_REFUSED = {
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EEXIST,
    errno.ELOOP,
    errno.ENAMETOOLONG,
    errno.EIO,
    errno.EINVAL,
    errno.EFBIG,
    # The folder was removed meanwhile, or is in a place where none can be made (/proc).
    errno.ENOENT,
}


@dataclass
class InstallationError(AerocalError):
    """The machine, not the project, prevents a run.

    Attributes
    ----------
    what : what is wrong, a sentence.
    remedy : what to do about it, a sentence.
    """

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what} {self.remedy}"


@contextmanager
def writing_into(folder: Path, option: str | None = "--out") -> Iterator[None]:
    """Turn "no space left", "permission denied" and the like while writing into one clear sentence.

    Parameters
    ----------
    option : names another folder; None: nothing does.

    Raises
    ------
    InstallationError
        If the disk or quota is full or `folder` may not be written; every other error passes.
    """
    elsewhere = f" or choose another folder with {option}" if option else ""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            raise InstallationError(
                f"There is no space left on the disk of {visible(str(folder), _SHOWN)}.",
                f"Free some space{elsewhere}, then run again; nothing half-written was kept.",
            ) from error
        # Of a file that is given its name, the name.
        file = error.filename2 or error.filename
        if error.errno in _REFUSED and _within(file, folder):
            raise InstallationError(
                f"{visible(str(file or folder), _SHOWN)} cannot be written ({error.strerror}).",
                f"Make it available and writable{elsewhere}.",
            ) from error
        raise


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file completely, or leave what was there.

    Raises
    ------
    InstallationError
        As of `writing_into`.
    """
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    with writing_into(path.parent):
        # A device or pipe stays one, and a link keeps leading to its file.
        if path.exists() and not path.is_file():
            path.write_bytes(data)
            return
        path = path.resolve()
        part = part_of(path)
        try:
            part.write_bytes(data)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def part_of(path: Path) -> Path:
    """The name of a file while this process writes it; short, as the file may have the longest there is."""
    return path.with_name(f"{_parts_of_machine()}{os.getpid()}.{zlib.crc32(os.fsencode(path.name)):08x}.part")


def remove_abandoned(folder: Path) -> None:
    """Remove unfinished files from a folder which nobody will finish.

    Those of processes of this machine that no longer exist, and those that nobody has written into for a day:
    other machines (containers, which have another name at each start) do not tell which processes they have.
    A process that has been stopped for so long fails when it gives its file a name, and loses nothing else.

    Raises
    ------
    InstallationError
        As of `writing_into`.
    """
    with writing_into(folder):
        for path in folder.iterdir() if folder.is_dir() else ():
            found = _PART.fullmatch(path.name)
            if found is not None and (_has_ended(found[1], int(found[2])) or _is_still(path)):
                path.unlink(missing_ok=True)


def _has_ended(machine: str, process: int) -> bool:
    return machine == _parts_of_machine() and not _exists(process)


def _is_still(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime > _STILL_S
    except FileNotFoundError:
        # It has been given its name.
        return False


def _parts_of_machine() -> str:
    """How the names of unfinished files begin: numbers of processes are those of a machine."""
    return f".aerocal.{re.sub(r'[^A-Za-z0-9-]', '-', machine())[-64:]}."


def _exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        # Another user's.
        return True
    return True


def _within(filename: object, folder: Path) -> bool:
    """Whether the file the system complained about lies in (or above) `folder`."""
    if filename is None:
        return True
    path = Path(str(filename)).absolute()
    return path.is_relative_to(folder.absolute()) or folder.absolute().is_relative_to(path)
