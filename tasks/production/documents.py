"""The pages of a run, shown only exactly as the run wrote them.

A document is named by the run and by a name of the manifest of its output folder; nothing else is a path.
Its bytes are held against the digest in the manifest before anybody sees them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import InputError
from tasks.files.delivered_file import lies_under, read_delivered
from tasks.production.records import Records
from tasks.production.run_record import PUBLISHING, RunRecord
from tasks.results.manifest import read_manifest

#: Kinds of files that are handed out, by the ending of the name.
MEDIA_TYPES = {
    ".html": "text/html",
    ".pdf": "application/pdf",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}

_RUN = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}")


class NoDocumentError(InputError):
    """There is no such document."""


class ChangedDocumentError(NoDocumentError):
    """The document has changed since the run wrote it."""


@dataclass(frozen=True)
class Document:
    """A document of a run.

    Attributes
    ----------
    name : of the file.
    media_type : of its content.
    content : its bytes.
    """

    name: str
    media_type: str
    content: bytes


def documents_of(run: RunRecord, folders: Sequence[Path]) -> tuple[str, ...]:
    """Names of the documents in the output folder of a run, according to the manifest."""
    return tuple(sorted(_digests(run, folders) or ()))


def read_document(records: Records, run_id: str, name: str, folders: Sequence[Path]) -> Document:
    """A document of a run, after its bytes were checked.

    Parameters
    ----------
    folders : it must lie under one of them, links resolved.

    Raises
    ------
    NoDocumentError
        If there is no such run or document, or a later run has replaced it.
    ChangedDocumentError
        If its bytes are not those that the manifest names.
    InputError, InstallationError
        If the records cannot be read.
    """
    run = records.run(run_id) if _RUN.fullmatch(run_id) else None
    if run is None:
        raise NoDocumentError("There is no run with this number.", "Use the links of the production page.")
    if not records.holds_results(run):
        raise NoDocumentError(*_without_results(run))
    digests = _digests(run, folders)
    if digests is None:
        there = lies_under(Path(run.directory), folders)
        where = "no longer where they were" if there else "outside the folders that this server may read"
        raise NoDocumentError(
            f"The results of {run.project} are {where}.", f"They were written into {run.directory}."
        )
    if name not in digests:
        known = ", ".join(sorted(digests)) or "none"
        raise NoDocumentError(
            "This run has not written a document with this name, or another run has replaced it.",
            f"Documents of this run of {run.project}: {known}.",
        )
    content = _content(run, name, folders)
    if hashlib.sha256(content).hexdigest() != digests[name]:
        raise ChangedDocumentError(
            f"{name} of {run.project} was changed after the run and is not shown.",
            "Run the project again: completed stages are reused, and the file is written again.",
        )
    return Document(name, MEDIA_TYPES[Path(name).suffix], content)


def _without_results(run: RunRecord) -> tuple[str, str]:
    if run.state not in PUBLISHING:
        return f"The run of {run.project} has no results: {run.state}.", run.message
    return f"A later run has replaced these results of {run.project}.", "Read those of the later run."


def _digests(run: RunRecord, folders: Sequence[Path]) -> dict[str, str] | None:
    """Digests of the documents of a run, by name; None: it has no manifest under the folders.

    A run that is not on record (``--server none``) may have written into the folder since.
    """
    directory = Path(run.directory)
    if not run.directory or not lies_under(directory / "manifest.json", folders):
        return None
    manifest = read_manifest(directory)
    if manifest is None:
        return None
    made = {one.key for one in run.stages if one.key}
    return {
        entry.file: entry.sha256
        for entry in manifest.artifacts.values()
        if _NAME.fullmatch(entry.file)
        and Path(entry.file).suffix in MEDIA_TYPES
        and (entry.key in made or not made)
    }


def _content(run: RunRecord, name: str, folders: Sequence[Path]) -> bytes:
    file = Path(run.directory) / name
    if not lies_under(file, folders):
        raise NoDocumentError(
            f"{name} of {run.project} is no longer where it was written.", "Run the project again."
        )
    try:
        return read_delivered(file.resolve(), "document")
    except InputError as error:
        raise NoDocumentError(f"{name} of {run.project} cannot be read. {error}", "") from error
