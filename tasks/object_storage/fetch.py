"""Download the results of a workspace on object storage into a folder, as left by an ordinary run."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import InputError
from tasks.files.delivered_file import require_folder
from tasks.files.installation import InstallationError, writing_into
from tasks.files.json_text import replace_json
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.workspace import ObjectWorkspace, PublishedEntry
from tasks.results.manifest import read_manifest, write_manifest
from tasks.results.own_files import UNFINISHED_FETCH, require_own, written_digests
from tasks.results.publish import remove_outdated
from tasks.results.summary import SUMMARY, Summary, write_summary
from tasks.store.artifact import digest_of_file
from tasks.store.run_lock import run_lock
from tasks.store.store import Store, remove_whole


@dataclass(frozen=True)
class FetchedResults:
    """What was downloaded.

    Attributes
    ----------
    files : names of all files of the results.
    brought : those that were not there already.
    last_run : how the last run ended; None if nothing can be said.
    """

    files: tuple[str, ...]
    brought: tuple[str, ...]
    last_run: Summary | None

    @property
    def is_older(self) -> bool:
        """Whether the last run ended without results, so that these are from an earlier run."""
        return self.last_run is not None and self.last_run.status in ("input_error", "not_computable")


def fetch_results(address: ObjectAddress, directory: Path) -> FetchedResults:
    """Download the files that the manifest at an address lists and that have changed.

    The files are those of one run, each is checked against its digest and appears whole; manifest.json is
    replaced last. Files of results that were there before and are none any more are removed, unless they
    were changed.

    Raises
    ------
    InputError
        If there are no results at the address, the folder is a file, or a file there would be replaced that
        no run or fetch has written, or that was changed since. Nothing is downloaded then.
    InstallationError
        If the storage does not answer or refuses, an object is missing or damaged, or the folder cannot be
        written.
    """
    require_folder(directory)
    workspace = ObjectWorkspace.at(address)
    workspace.require_access()
    manifest = workspace.manifest()
    if manifest is None:
        raise InputError(
            f"There are no results at {address}.", "Correct the address, or run a project with it as --out."
        )
    last_run = workspace.storage.document(SUMMARY, Summary)
    entries = tuple(manifest.artifacts.values())
    with writing_into(directory), run_lock(directory):
        last = read_manifest(directory)
        coming = {entry.sha256 for entry in entries}
        require_own(directory, last, (entry.file for entry in entries), coming)
        there = _digests_there(directory, entries)
        for leftover in Store.of(directory).leftovers():
            remove_whole(leftover)
        replace_json(directory / UNFINISHED_FETCH, sorted(coming | written_digests(directory, last)))
        missing = [entry for entry in entries if there.get(entry.file) != entry.sha256]
        for entry in missing:
            _bring(workspace, entry, directory)
        here = manifest.of_folder()
        if last is not None:
            remove_outdated(directory, last, here, tuple(last.artifacts))
        write_summary(directory, manifest.summary)
        write_manifest(directory, here)
        (directory / UNFINISHED_FETCH).unlink()
    files, brought = (tuple(entry.file for entry in some) for some in (entries, missing))
    return FetchedResults(tuple(sorted(files)), brought, last_run)


def _digests_there(directory: Path, entries: Sequence[PublishedEntry]) -> dict[str, str]:
    """By name, the digests of the files that are present."""
    paths = (directory / entry.file for entry in entries)
    return {path.name: digest_of_file(path) for path in paths if path.is_file()}


def _bring(workspace: ObjectWorkspace, entry: PublishedEntry, directory: Path) -> None:
    """Download a file; it appears whole."""
    target = directory / entry.file
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        found = workspace.storage.download(entry.object, temporary)
        if found != entry.sha256:
            address, wrong = workspace.storage.address, "missing" if found is None else "damaged"
            raise InstallationError(
                f"{address}/{entry.object} is {wrong}.",
                f"Run the project again with --out {address}: missing or damaged files are written again.",
            )
        temporary.chmod(temporary.stat().st_mode & 0o555)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
