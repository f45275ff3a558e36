"""A workspace on object storage: what lies where below its prefix, and in which order it is put there.

``.store/STAGE/KEY/SHA256/FILE``
    the files of a stage output, named by their digest: whoever puts there the same name puts the same bytes.
``.store/STAGE/KEY/stage.json``
    put after all of them; another machine takes the output up from here instead of computing it.
``summary.json``
    how the last run ended, whatever its end was.
``manifest.json``
    put last: the results (`tasks.object_storage.published_manifest`).
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.published_manifest import PublishedManifest, published_manifest_from
from tasks.object_storage.stage_listing import (
    STAGE_FILE,
    ListedFile,
    StageListing,
    folder_of,
    stage_listing_from,
)
from tasks.object_storage.storage import ObjectStorage
from tasks.storage.json_text import JSON, from_json, json_text
from tasks.storage.manifest import MANIFEST
from tasks.storage.stage_key import StageKey
from tasks.summary import SUMMARY

_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class ObjectWorkspace:
    """A `tasks.storage.remote.Remote` on object storage: finished outputs for every machine, and results.

    Attributes
    ----------
    storage : the objects below the prefix.
    """

    storage: ObjectStorage

    @classmethod
    def at(cls, address: ObjectAddress) -> ObjectWorkspace:
        """The workspace at an address."""
        return cls(ObjectStorage(address))

    def require_access(self) -> None:
        """Ask whether the storage answers and lets us in."""
        self.storage.require_access()

    def take(self, key: StageKey, folder: Path) -> float | None:
        """Download the output of a stage; see `tasks.storage.remote.Remote`."""
        listing = self.storage.document(
            f"{folder_of(key.stage, key.digest)}/{STAGE_FILE}", partial(stage_listing_from, key=key)
        )
        if listing is None:
            return None
        for file in listing.files:
            if self.storage.download(listing.object_of(file), folder / file.file) != file.sha256:
                _log.warning("%s: %s in %s is damaged", key.stage, file.file, self.storage.address)
                return None
        return listing.seconds

    def put(self, key: StageKey, folder: Path) -> None:  # noqa: ARG002
        """Put a stage output there, its list of files last."""
        listing = _listing(folder)
        self._put_files(listing, listing.files, folder)

    def put_missing(self, key: StageKey, folder: Path) -> None:
        """Put a stage output there as far as a look at the names, sizes and times there calls for it."""
        listing = _listing(folder)
        missing = listing.to_be_put(self.storage.listing(folder_of(key.stage, key.digest)))
        if missing:
            self._put_files(listing, missing, folder)

    def _put_files(self, listing: StageListing, files: Sequence[ListedFile], folder: Path) -> None:
        for file in files:
            self.storage.upload(folder / file.file, listing.object_of(file))
        self.storage.upload(folder / STAGE_FILE, f"{folder_of(listing.stage, listing.key)}/{STAGE_FILE}")

    def manifest(self) -> PublishedManifest | None:
        """The manifest of the last run with results; None if there is none, or none that can be read."""
        return self.storage.document(MANIFEST, published_manifest_from)

    def publish(
        self, manifest: Mapping[str, JSON], summary: Mapping[str, JSON], own: Collection[str]
    ) -> None:
        """Point to the results of a run; see `tasks.storage.remote.Remote`."""
        published = PublishedManifest.model_validate({**manifest, "summary": summary})
        last = self.manifest()
        if last is not None:
            published = published.beside(last, own)
        self.tell(summary)
        self._put_json(MANIFEST, published.to_json())
        _log.info("published at %s", self.storage.address)

    def tell(self, summary: Mapping[str, JSON]) -> None:
        """Say how a run ended; the results that the manifest points to stay as they are."""
        self._put_json(SUMMARY, summary)

    def _put_json(self, name: str, content: JSON) -> None:
        self.storage.put(name, (json_text(content, indent=2) + "\n").encode())


def _listing(folder: Path) -> StageListing:
    """The files of a finished output of this machine."""
    return StageListing.model_validate(from_json((folder / STAGE_FILE).read_bytes()))
