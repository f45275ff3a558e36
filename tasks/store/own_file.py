"""Files that may be replaced: those that we have written, unchanged since."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

from tasks.errors import InputError, Location
from tasks.store.artifact import digest_of_unchanged


def not_written(paths: Iterable[Path], digests: Collection[str]) -> tuple[Path, ...]:
    """Those of some files that exist with other bytes than these.

    Parameters
    ----------
    digests : SHA-256 of all that was or will be written there, hexadecimal.
    """
    return tuple(path for path in paths if path.is_file() and digest_of_unchanged(path) not in digests)


def would_be_lost(path: Path) -> InputError:
    """The refusal to replace a file."""
    return Location(path).error(
        "The file would be replaced, but it is not by aerocal or was changed since.",
        "Rename it, or choose another output folder.",
    )
