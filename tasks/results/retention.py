"""Clean-up of output folders: stored outputs unused for a long time, never those listed in a manifest.

Outputs listed in ``manifest.json``, as published files or as stages of the last run, are always kept, and
so are the outputs they were made from: a rerun of the last stage stays cheap. Everything else can be
computed again, and is removed when it has not been used for some time. Nothing is removed from a folder to
which a run is writing, or whose manifest cannot be read.

An output is first renamed and then removed, so that a process killed in between leaves an intact store; the
rest is removed by the next run or clean-up.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, TypeAlias, cast

from tasks.errors import AerocalError
from tasks.files.json_text import JSON, read_json
from tasks.results.manifest import MANIFEST, Manifest, read_manifest
from tasks.store.run_lock import run_lock_if_free
from tasks.store.store import STAGE_FILE, Store, remove_whole

#: Days without use after which an output that no manifest names is removed.
KEEP_DAYS = 90
#: How deep below a folder output folders are looked for.
DEPTH = 8

#: Why an output stays: a manifest names it, one that is named was made from it, or it was used lately.
Why: TypeAlias = Literal["named", "upstream", "recent"]
_KEY = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class StoredOutput:
    """One stage's output in a store.

    Attributes
    ----------
    stage, key : which one it is.
    folder : where it lies.
    last_used : when it was last made or used.
    size : bytes that its removal frees; files that are also published take no extra space.
    made, made_from : digests of its files, and of the artifacts it was made from; none if its list is
        damaged.
    """

    stage: str
    key: str
    folder: Path
    last_used: datetime
    size: int
    made: frozenset[str]
    made_from: frozenset[str]

    @classmethod
    def at(cls, folder: Path) -> StoredOutput:
        """The output in a folder ``…/STAGE/KEY``."""
        made, made_from = _digests(folder / STAGE_FILE)
        used = _used_ns(folder)
        return cls(
            folder.parent.name,
            folder.name,
            folder,
            datetime.fromtimestamp(used / 1e9, UTC),
            _size(folder),
            made,
            made_from,
        )

    @property
    def name(self) -> tuple[str, str]:
        """Stage and key, as a manifest names it."""
        return self.stage, self.key


@dataclass(frozen=True)
class CleanUp:
    """What a clean-up removes from one output folder, and what it keeps.

    Attributes
    ----------
    directory : the output folder.
    removed : outputs that are removed.
    leftovers : what killed runs left behind, which is also removed.
    leftover_size : bytes in them.
    kept : outputs that are kept, with the reason.
    refusal : why nothing (more) was removed, a sentence; None: there was no obstacle.
    """

    directory: Path
    removed: tuple[StoredOutput, ...] = ()
    leftovers: tuple[Path, ...] = ()
    leftover_size: int = 0
    kept: tuple[tuple[StoredOutput, Why], ...] = ()
    refusal: str | None = None

    @property
    def freed(self) -> int:
        """Bytes that are freed."""
        return sum(output.size for output in self.removed) + self.leftover_size


def look_through(directory: Path, unused_since: datetime, roots: Sequence[Path] = ()) -> CleanUp:
    """What a clean-up would remove from an output folder; nothing is changed.

    Parameters
    ----------
    unused_since : outputs not in a manifest and not used since then are removed.
    roots : folders, links resolved, one of which it must lie under; empty: anywhere.
    """
    return _with_lock(directory, unused_since, roots, lambda found: found)


def clean_up(directory: Path, unused_since: datetime, roots: Sequence[Path] = ()) -> CleanUp:
    """Remove from an output folder what is no longer needed; parameters as of `look_through`."""
    return _with_lock(directory, unused_since, roots, _carry_out)


def output_folders(tops: Iterable[Path], depth: int = DEPTH) -> tuple[Path, ...]:
    """The output folders at and below some folders: those with a store. Links are not followed."""
    found: dict[Path, None] = {}
    for top in tops:
        base = len(top.parts)
        for at, folders, _files in os.walk(top):
            here = Path(at)
            if (here / ".store").is_dir() and not (here / ".store").is_symlink():
                found[here] = None
            below = len(here.parts) - base < depth
            folders[:] = sorted(name for name in folders if below and not name.startswith("."))
    return tuple(found)


def _with_lock(
    directory: Path,
    unused_since: datetime,
    roots: Sequence[Path],
    carry_out: Callable[[CleanUp], CleanUp],
) -> CleanUp:
    try:
        with run_lock_if_free(directory, roots) as held:
            if not held:
                return CleanUp(directory, refusal="A run is writing to it: nothing is removed.")
            return carry_out(_inspected(directory, unused_since))
    except AerocalError as error:
        return CleanUp(directory, refusal=str(error))
    except OSError as error:
        return CleanUp(directory, refusal=f"It cannot be read ({error}): nothing is removed.")


def _inspected(directory: Path, unused_since: datetime) -> CleanUp:
    manifest = read_manifest(directory)
    if manifest is None and os.path.lexists(directory / MANIFEST):
        return CleanUp(directory, refusal=f"Its {MANIFEST} cannot be read: nothing is removed.")
    store = Store.of(directory)
    outputs = tuple(_outputs(store.folder))
    needed = _needed(outputs, frozenset() if manifest is None else _named(manifest))
    kept: list[tuple[StoredOutput, Why]] = []
    removed: list[StoredOutput] = []
    for output in outputs:
        if output.name in needed:
            kept.append((output, needed[output.name]))
        elif output.last_used >= unused_since:
            kept.append((output, "recent"))
        else:
            removed.append(output)
    leftovers = store.leftovers()
    size = sum(_size(leftover) for leftover in leftovers)
    return CleanUp(directory, tuple(removed), leftovers, size, tuple(kept))


def _carry_out(found: CleanUp) -> CleanUp:
    gone: list[StoredOutput] = []
    try:
        for leftover in found.leftovers:
            remove_whole(leftover)
        for output in found.removed:
            remove_whole(output.folder)
            gone.append(output)
    except OSError as error:
        refusal = f"{error.filename or found.directory} cannot be removed ({error.strerror})."
        return CleanUp(found.directory, tuple(gone), kept=found.kept, refusal=refusal)
    return found


def _named(manifest: Manifest) -> frozenset[tuple[str, str]]:
    """The outputs a manifest names: of its files, those of other kinds of runs included, and its stages."""
    published = {(entry.stage, entry.key) for entry in manifest.artifacts.values()}
    return frozenset(published | {(entry.stage, entry.key) for entry in manifest.stages})


def _needed(
    outputs: Collection[StoredOutput], named: frozenset[tuple[str, str]]
) -> dict[tuple[str, str], Why]:
    """The outputs that are named, and those these were made from, over any number of stages.

    Where several outputs of a stage hold the same bytes and none is needed yet, the one that was used last
    stays.
    """
    needed: dict[tuple[str, str], Why] = {output.name: "named" for output in outputs if output.name in named}
    holders: dict[str, dict[str, list[StoredOutput]]] = {}
    for output in sorted(outputs, key=lambda one: one.last_used, reverse=True):
        for digest in output.made:
            holders.setdefault(digest, {}).setdefault(output.stage, []).append(output)
    ahead = [output for output in outputs if output.name in needed]
    while ahead:
        for digest in ahead.pop().made_from:
            for alike in holders.get(digest, {}).values():
                if not any(output.name in needed for output in alike):
                    needed[alike[0].name] = "upstream"
                    ahead.append(alike[0])
    return needed


def _outputs(store: Path) -> Iterator[StoredOutput]:
    """The outputs of a store, by stage and key; other content is not ours."""
    for stage in sorted(store.iterdir()):
        if stage.is_dir() and not stage.is_symlink():
            for folder in sorted(stage.iterdir()):
                if _KEY.fullmatch(folder.name) and folder.is_dir() and not folder.is_symlink():
                    yield StoredOutput.at(folder)


def _used_ns(folder: Path) -> int:
    try:
        return (folder / STAGE_FILE).stat().st_mtime_ns
    except FileNotFoundError:
        return folder.stat().st_mtime_ns


def _digests(file: Path) -> tuple[frozenset[str], frozenset[str]]:
    """Digests in the list of an output: of its files, and of the artifacts in its key."""
    try:
        content = cast(Mapping[str, JSON], read_json(file))
        files = cast(list[Mapping[str, JSON]], content["files"])
        return frozenset(str(entry["sha256"]) for entry in files), frozenset(_artifacts(content["key_parts"]))
    except (OSError, ValueError, KeyError, TypeError):
        return frozenset(), frozenset()


def _artifacts(part: JSON) -> Iterator[str]:
    """The digests of artifacts anywhere in the parts of a key (`tasks.store.stage_key`)."""
    if isinstance(part, Mapping):
        digest = part.get("artifact")
        if isinstance(digest, str):
            yield digest
        for value in part.values():
            yield from _artifacts(value)
    elif isinstance(part, list):
        for value in part:
            yield from _artifacts(value)


def _size(place: Path) -> int:
    """Bytes of a file or folder, without what has another name elsewhere."""
    files = [place] if not place.is_dir() else [path for path in place.rglob("*") if path.is_file()]
    status = [path.lstat() for path in files]
    return sum(one.st_size for one in status if one.st_nlink == 1)
