"""Delivered files: opened in one place, ordinary files only, none larger than this installation accepts.

A file that somebody delivers may be a device, a pipe, a folder, a link that was put there a moment ago, or
without end. Every reader of delivered files opens them here; what is wrong is said in one sentence before any
of it is in memory. The limits are of the installation, in its environment, and never of a project file.

| variable | limits | default |
|---|---|---|
| ``AEROCAL_MAX_TABLE_MB`` | a file of image points, exposures or control, a geoid grid, a table of another run | 4000 |
| ``AEROCAL_MAX_DOCUMENT_MB`` | a camera file, a calibration, a marker file | 20 |
| ``AEROCAL_MAX_SETTINGS_MB`` | a project file, a specification | 1 |
| ``AEROCAL_MAX_ROWS`` | rows of one file | 100 000 000 |

A block of 50,000 images has about 12 million image points in 1 to 2 GB of text.
"""  # noqa: E501

from __future__ import annotations

import hashlib
import math
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.errors import InputError, Location
from tasks.files.in_turn import in_turn
from tasks.files.installation import InstallationError

#: What a file is: one of rows, one that is read as a whole, or one that people write.
Kind: TypeAlias = Literal["table", "document", "settings"]

TABLE_VARIABLE = "AEROCAL_MAX_TABLE_MB"
DOCUMENT_VARIABLE = "AEROCAL_MAX_DOCUMENT_MB"
SETTINGS_VARIABLE = "AEROCAL_MAX_SETTINGS_MB"
ROWS_VARIABLE = "AEROCAL_MAX_ROWS"
_MB = 1_000_000
#: Digests that files had when the stage began that is reading them.
_DIGESTS: ContextVar[Mapping[Path, str] | None] = ContextVar("digests", default=None)


@dataclass(frozen=True)
class FileLimits:
    """Limits of this installation for delivered files.

    Attributes
    ----------
    table_mb, document_mb : largest files of the two kinds, 10⁶ bytes.
    rows : most rows of one file.
    settings_mb : largest file of settings, 10⁶ bytes.
    """

    table_mb: int = 4_000
    document_mb: int = 20
    rows: int = 100_000_000
    settings_mb: int = 1

    def trouble(self, path: Path, size: int, kind: Kind) -> InputError | None:
        """What is wrong with a file of this size, bytes; None: nothing."""
        most, variable = {
            "table": (self.table_mb, TABLE_VARIABLE),
            "document": (self.document_mb, DOCUMENT_VARIABLE),
            "settings": (self.settings_mb, SETTINGS_VARIABLE),
        }[kind]
        if size <= most * _MB:
            return None
        return Location(path).error(
            f"The file has {math.ceil(size / _MB):,} MB, more than the {most:,} MB that this "
            "installation accepts.",
            f"Deliver the right file, or divide it; the administrator can raise {variable}.",
        )

    def require_rows(self, path: Path, rows: int) -> None:
        """Refuse a file with too many rows.

        Raises
        ------
        InputError
            If it has.
        """
        if rows > self.rows:
            raise Location(path).error(
                f"The file has {rows:,} rows, more than the {self.rows:,} that this installation accepts.",
                f"Deliver the right file, or divide it; the administrator can raise {ROWS_VARIABLE}.",
            )


def file_limits(environment: Mapping[str, str] = os.environ) -> FileLimits:
    """The limits of this installation.

    Raises
    ------
    InstallationError
        If a variable is set to something else than a positive whole number.
    """
    usual = FileLimits()
    return FileLimits(
        _number(environment, TABLE_VARIABLE, usual.table_mb),
        _number(environment, DOCUMENT_VARIABLE, usual.document_mb),
        _number(environment, ROWS_VARIABLE, usual.rows),
        _number(environment, SETTINGS_VARIABLE, usual.settings_mb),
    )


def _number(environment: Mapping[str, str], variable: str, usual: int) -> int:
    text = environment.get(variable, "").strip()
    if not text:
        return usual
    if not (text.isascii() and text.isdecimal() and len(text) < 16 and int(text) > 0):
        raise InstallationError(
            f"{variable} is '{text}', which is not a valid limit.",
            "Set it to a positive whole number, or not at all.",
        )
    return int(text)


def lies_under(path: Path, folders: Iterable[Path]) -> bool:
    """Whether a path, all links resolved, lies under one of the folders; an invalid path does not."""
    try:
        resolved = path.resolve()
    except (OSError, RuntimeError, ValueError):
        # Links in a circle, too long a name, a null character.
        return False
    return any(resolved.is_relative_to(folder) for folder in folders)


def require_none_replaced(targets: Iterable[Path], delivered: Iterable[str | Path]) -> None:
    """Refuse to write files of which one would replace a delivered one.

    Raises
    ------
    InputError
        Naming it.
    """
    taken = {Path(path).resolve() for path in delivered}
    for target in targets:
        if target.resolve() in taken:
            raise Location(target).error(
                "This is a delivered file, which the results would replace.", "Choose another output folder."
            )


def trouble_of_folder(folder: Path) -> InputError | None:
    """Why results cannot go into a folder: there is a file, or one on the way to it; None: they can."""
    there = next((place for place in (folder, *folder.absolute().parents) if is_there(place)), None)
    if there is None or there.is_dir():
        return None
    return Location(there).error(
        "This is a file, not a folder.", "Rename it, or choose another output folder."
    )


def require_folder(folder: Path) -> None:
    """Refuse a folder for results; raises the error of `trouble_of_folder`."""
    trouble = trouble_of_folder(folder)
    if trouble is not None:
        raise trouble


def is_there(path: Path) -> bool:
    """Whether there is anything at a path; False for an impossible path.

    Raises
    ------
    InputError
        If a folder on the way to it may not be entered.
    """
    try:
        path.stat()
    except PermissionError as error:
        raise _unreadable(path, error) from error
    except (OSError, ValueError):
        return False
    return True


def trouble_of(path: Path, kind: Kind = "table") -> InputError | None:
    """Why this file would be refused, as far as is known without opening it; None: it would not."""
    try:
        status = path.stat()
    except OSError as error:
        return _unreadable(path, error)
    return _trouble_of_status(path, status, kind)


def read_delivered(path: Path, kind: Kind) -> bytes:
    """The bytes of a delivered file.

    Raises
    ------
    InputError
        As of `opened`; if it grows while it is read; if its bytes are not those of `keyed_by`.
    """
    with opened(path, kind) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = stream.read(size + 1)
    if len(content) > size:
        raise _grows(path)
    keyed = (_DIGESTS.get() or {}).get(path)
    if keyed is not None and hashlib.sha256(content).hexdigest() != keyed:
        raise changed(path)
    return content


def pieces_of_delivered(path: Path, kind: Kind, size: int) -> Iterator[bytes]:
    """The bytes of a delivered file in pieces of a size, so that it is never in memory as a whole.

    Raises
    ------
    InputError
        As of `read_delivered`; that the bytes are others shows after the last of them.
    """
    digest = hashlib.sha256()
    keyed = (_DIGESTS.get() or {}).get(path)

    def digested(piece: bytes) -> bytes:
        digest.update(piece)
        return piece

    with opened(path, kind) as stream:
        pieces = _pieces(stream, path, size)
        # While a piece is used, the digest of the next one is made.
        yield from pieces if keyed is None else in_turn(digested, pieces, threads=1)
    if keyed is not None and digest.hexdigest() != keyed:
        raise changed(path)


def _pieces(stream: BufferedReader, path: Path, size: int) -> Iterator[bytes]:
    left = os.fstat(stream.fileno()).st_size
    while piece := stream.read(size):
        left -= len(piece)
        if left < 0:
            raise _grows(path)
        yield piece


def _grows(path: Path) -> InputError:
    return Location(path).error("The file grows while it is being read.", "Wait until it has been delivered.")


def digest_of_delivered(path: Path) -> str:
    """SHA-256 of a delivered file's bytes, hexadecimal.

    Raises
    ------
    InputError
        As of `opened`.
    """
    with opened(path, "table") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_for_key(path: Path) -> str:
    """The digest of a delivered file that is in `keyed_by`, else that of its bytes now.

    Raises
    ------
    InputError
        As of `opened`.
    """
    return (_DIGESTS.get() or {}).get(path) or digest_of_delivered(path)


@contextmanager
def keyed_by(digests: Mapping[Path, str]) -> Iterator[None]:
    """While a stage runs, its key and everything it reads refer to the bytes with these digests."""
    token = _DIGESTS.set(digests)
    try:
        yield
    finally:
        _DIGESTS.reset(token)


def changed(path: Path) -> InputError:
    """The error that a file has changed since the stage that reads it began."""
    return Location(path).error(
        "The file changed while it was being read.",
        "Wait until it has been delivered completely, then run again.",
    )


@contextmanager
def opened(path: Path, kind: Kind) -> Iterator[BufferedReader]:
    """A delivered file, open for reading.

    Parameters
    ----------
    path : without links, as `Path.resolve` gives it: where a file may lie has been checked of this path, so
        one that has since become a link is not followed.

    Raises
    ------
    InputError
        If it cannot be opened, is not an ordinary file (a folder, device or pipe), is larger than this
        installation takes, or does not lie at its path.
    """
    try:
        # Without waiting: a pipe that nobody writes into would hold the run for ever.
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    try:
        status = os.fstat(handle)
        trouble = _trouble_of_status(path, status, kind) or _trouble_of_place(path, status)
        if trouble is not None:
            raise trouble
        with os.fdopen(handle, "rb", closefd=False) as stream:
            yield stream
    finally:
        os.close(handle)


def _unreadable(path: Path, error: OSError | ValueError) -> InputError:
    reason = error.strerror if isinstance(error, OSError) else "no path"
    return Location(path).error(f"The file cannot be read ({reason}).", "Check the path.")


def _trouble_of_status(path: Path, status: os.stat_result, kind: Kind) -> InputError | None:
    if not stat.S_ISREG(status.st_mode):
        return Location(path).error(
            "This is not an ordinary file, but a folder, device or pipe.", "Correct the path."
        )
    return file_limits().trouble(path, status.st_size, kind)


def _trouble_of_place(path: Path, status: os.stat_result) -> InputError | None:
    """Whether what was opened is what lies at the path itself, and not where a link on it leads."""
    try:
        if path.absolute() == path.resolve() and os.path.samestat(path.stat(), status):
            return None
    except (OSError, RuntimeError):
        # Gone, or links in a circle: not there any more either way.
        pass
    return Location(path).error(
        "The path contains a link that did not exist before.", "Deliver the file itself."
    )
