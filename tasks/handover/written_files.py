"""The files of an export: from their digests in HANDOVER.txt, the next export knows what it may replace."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path

from tasks.files.installation import remove_abandoned, write_whole, writing_into
from tasks.store.own_file import not_written, would_be_lost

STATEMENT = "HANDOVER.txt"
_UNFINISHED = "This export is not complete: repeat it.\n"
_OF_TEXT, _OF_FILES = "\nSHA-256 of the text above: ", "SHA-256 of the files:\n"
#: As `sha256sum --check` reads it; somebody may have delivered the folder, so a name leads nowhere else.
_LINE = re.compile(r"^(?P<digest>[0-9a-f]{64})  (?P<name>[^/\n]+)$", re.MULTILINE)
#: Name and digest of each file.
_Listed = tuple[tuple[str, str], ...]


def write_files(folder: Path, files: Mapping[str, str | bytes], text: str) -> None:
    """Write all files of an export, each completely or not at all, and HANDOVER.txt last.

    Parameters
    ----------
    files : name → content.
    text : about them, for HANDOVER.txt.

    Raises
    ------
    InputError
        If a file in the folder would be replaced that no export has written, or that was changed since.
        Nothing is written then.
    InstallationError
        If the folder cannot be written.
    """
    contents = {name: text.encode() if isinstance(text, str) else text for name, text in files.items()}
    made = tuple((name, sha256(content).hexdigest()) for name, content in contents.items())
    earlier = _listed(folder)
    others = not_written((folder / name for name in contents), {digest for _, digest in (*earlier, *made)})
    others += (folder / STATEMENT,) if _is_edited(folder) else ()
    if others:
        raise would_be_lost(others[0])
    kept = tuple(one for one in earlier if one[0] not in contents and (folder / one[0]).is_file())
    with writing_into(folder):
        folder.mkdir(parents=True, exist_ok=True)
        remove_abandoned(folder)
        # An export that is killed leaves files of either kind.
        write_whole(folder / STATEMENT, _with_digests(_UNFINISHED, (*earlier, *made)))
        for name, content in contents.items():
            write_whole(folder / name, content)
        write_whole(folder / STATEMENT, _with_digests(text, (*made, *kept)))


def remove_written(folder: Path) -> None:
    """Remove what exports have written into a folder and nobody has changed since."""
    listed = _listed(folder)
    there = {path for name, _ in listed if (path := folder / name).is_file()}
    changed = not_written(there, {digest for _, digest in listed})
    with writing_into(folder):
        if not _is_edited(folder):
            (folder / STATEMENT).unlink(missing_ok=True)
        for path in there.difference(changed):
            path.unlink()


def _with_digests(text: str, files: Iterable[tuple[str, str]]) -> str:
    lines = (f"{digest}  {name}\n" for name, digest in files)
    return f"{text}{_OF_TEXT}{sha256(text.encode()).hexdigest()}\n{_OF_FILES}{''.join(lines)}"


def _listed(folder: Path) -> _Listed:
    """What HANDOVER.txt of a folder lists."""
    _, _, lines = _stated(folder).partition(_OF_FILES)
    return tuple((found["name"], found["digest"]) for found in _LINE.finditer(lines))


def _is_edited(folder: Path) -> bool:
    """Whether there is a HANDOVER.txt that is not as an export has written it."""
    text, _, _ = _stated(folder).rpartition(_OF_TEXT)
    return (folder / STATEMENT).exists() and _stated(folder) != _with_digests(text, _listed(folder))


def _stated(folder: Path) -> str:
    file = folder / STATEMENT
    return file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
