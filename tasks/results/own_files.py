"""Files of an output folder that may be replaced: those that runs and fetches have written, unchanged since.

Which these are is known by their digests: from the manifest there, from the stages in the store (a killed run
has published files that no manifest names) and from what an interrupted fetch has noted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import cast

from tasks.errors import InputError
from tasks.files.delivered_file import is_there
from tasks.files.json_text import read_json
from tasks.results.manifest import MANIFEST, Manifest
from tasks.results.summary import SUMMARY
from tasks.store.own_file import not_written, would_be_lost
from tasks.store.store import Store

#: Digests of the files that an unfinished fetch may have left.
UNFINISHED_FETCH = Path(".store", "fetching.json")


def require_own(
    directory: Path, last: Manifest | None, names: Iterable[str], coming: Collection[str]
) -> None:
    """Refuse to write results into a folder where a file of somebody else would be lost.

    Parameters
    ----------
    last : the manifest in the folder.
    names : of the files that are about to be written.
    coming : digests of these: who has the same bytes loses nothing.

    Raises
    ------
    InputError
        If a file there is not by aerocal or was changed since, naming it.
    """
    foreign = foreign_document(directory)
    if foreign is not None:
        raise foreign
    others = not_written((directory / name for name in names), {*coming, *written_digests(directory, last)})
    others = not_written(others, Store.of(directory).listed_digests()) if others else ()
    if others:
        raise would_be_lost(others[0])


def written_digests(directory: Path, last: Manifest | None) -> set[str]:
    """Digests of what the manifest in a folder lists, and of what interrupted fetches have left."""
    own = set() if last is None else {entry.sha256 for entry in last.artifacts.values()}
    with suppress(OSError, ValueError, TypeError):
        own.update(cast(list[str], read_json(directory / UNFINISHED_FETCH)))
    return own


def foreign_document(directory: Path) -> InputError | None:
    """The refusal of a folder with a summary.json or manifest.json of somebody else; None: there is none."""
    for name in (SUMMARY, MANIFEST):
        path = directory / name
        if is_there(path) and not _is_ours(path):
            return would_be_lost(path)
    return None


def _is_ours(document: Path) -> bool:
    try:
        content = read_json(document)
    except (OSError, ValueError):
        return False
    return isinstance(content, Mapping) and "contract_version" in content
