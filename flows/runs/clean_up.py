"""Clean up output folders: outputs unused for long are removed, those named by a manifest are kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.errors import InputError
from tasks.results.retention import CleanUp, Why, clean_up, look_through, output_folders

#: Whether things are removed, or it is only said what would be.
Act: TypeAlias = Literal["remove", "look"]
_ACTS = {"remove": clean_up, "look": look_through}
_WHY: dict[Why, str] = {
    "named": "named by a manifest",
    "upstream": "input of these",
    "recent": "used lately",
}


@dataclass(frozen=True)
class CleanedFolders:
    """What a clean-up of several output folders has done, or would do.

    Attributes
    ----------
    act : which of the two.
    folders : folder by folder.
    """

    act: Act
    folders: tuple[CleanUp, ...]

    @property
    def freed(self) -> int:
        """Bytes that were freed."""
        return sum(one.freed for one in self.folders)

    @property
    def refused(self) -> tuple[CleanUp, ...]:
        """Folders from which nothing, or not everything, was removed."""
        return tuple(one for one in self.folders if one.refusal is not None)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Totals, what was kept and why, and what prevented removals."""
        return tuple(self._sentences())

    def _sentences(self) -> Iterator[str]:
        removed = sum(len(one.removed) for one in self.folders)
        leftovers = sum(len(one.leftovers) for one in self.folders)
        verb = "Removed" if self.act == "remove" else "Would remove"
        what = f"{_counted(removed, 'stored output')} and {_counted(leftovers, 'leftover')} of killed runs"
        where = _counted(len(self.folders), "output folder")
        yield f"{verb} {what}, {megabytes(self.freed)}, from {where}."
        kept = [why for one in self.folders for _output, why in one.kept]
        if kept:
            parts = [f"{kept.count(why)} {words}" for why, words in _WHY.items() if why in kept]
            yield f"Kept: {', '.join(parts)}."
        yield from (f"{one.directory}: {one.refusal}" for one in self.refused)


def clean_up_below(tops: Sequence[Path], keep_days: int, act: Act) -> CleanedFolders:
    """Clean up all output folders at and below some folders.

    Parameters
    ----------
    keep_days : days for which outputs not in a manifest are kept after their last use.

    Raises
    ------
    InputError
        If one of them is not a folder.
    """
    for top in tops:
        if not top.is_dir():
            raise InputError(
                f"There is no folder {top}.",
                "Name an output folder, or a folder that contains output folders.",
            )
    unused_since = datetime.now(UTC) - timedelta(days=keep_days)
    roots = [top.resolve() for top in tops]
    folders = output_folders(roots)
    return CleanedFolders(act, tuple(_ACTS[act](folder, unused_since, roots) for folder in folders))


def megabytes(size: int) -> str:
    """A number of bytes in megabytes."""
    return f"{size / 1e6:,.1f} MB"


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}{'s' * (count != 1)}"
