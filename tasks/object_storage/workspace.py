"""A workspace on object storage: its layout below the prefix, and the order of uploads.

pyarrow puts and reads single objects; which of them belong together is said here.

``.store/STAGE/KEY/SHA256/FILE``
    the files of a stage output, named by their digest: whoever puts there the same name puts the same bytes.
``.store/STAGE/KEY/stage.json``
    put after all of them; another machine takes the output up from here instead of computing it.
``summary.json``
    how the last run ended, whatever its end was.
``manifest.json``
    put last, the only pointer to results: the manifest of an output folder, with the name of the object of
    each file and the whole summary. One PUT replaces everything a reader goes by.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, Field, computed_field

from tasks.files.json_text import JSON, from_json, json_text
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.storage import ObjectStorage, StoredObject
from tasks.results.manifest import MANIFEST, Manifest, ManifestEntry
from tasks.results.summary import SUMMARY, Summary
from tasks.store.stage_key import StageKey

STORE = ".store"
STAGE_FILE = "stage.json"


def _plain(name: str) -> str:
    """A name that cannot lead outside its folder."""
    if name in ("", ".", "..") or PurePosixPath(name).name != name or "\\" in name or "\0" in name:
        raise ValueError("not a plain file name")
    return name


#: What was read from the storage is checked like any delivery: a name there must not lead elsewhere here.
PlainName: TypeAlias = Annotated[str, AfterValidator(_plain), Field(max_length=200)]
Digest: TypeAlias = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def folder_of(stage: str, key: str) -> str:
    """Folder of the output of a stage."""
    return f"{STORE}/{stage}/{key}"


def object_of(stage: str, key: str, sha256: str, file: str) -> str:
    """Name of the object of a file, which contains its digest, so that every upload has the same bytes."""
    return f"{folder_of(stage, key)}/{sha256}/{file}"


class ListedFile(BaseModel, frozen=True):
    """A file of a stage output: name, digest and size."""

    file: PlainName
    sha256: Digest
    bytes: Annotated[int, Field(ge=0)]


class StageListing(BaseModel, frozen=True):
    """A finished stage output: which files, and the seconds it once took to compute them."""

    stage: PlainName
    key: Digest
    files: tuple[ListedFile, ...]
    seconds: float

    def object_of(self, file: ListedFile) -> str:
        """Name of the object of one of the files."""
        return object_of(self.stage, self.key, file.sha256, file.file)

    def to_be_put(self, there: Mapping[str, StoredObject]) -> tuple[ListedFile, ...]:
        """The files whose objects are missing or have changed.

        stage.json is put last, so an object of another size or a later time was changed by somebody.

        Parameters
        ----------
        there : the objects in the folder of the output.
        """
        completed = there.get(STAGE_FILE)
        if completed is None:
            return self.files
        found = {file: there.get(f"{file.sha256}/{file.file}") for file in self.files}
        return tuple(file for file in self.files if not _intact(file, found[file], completed))


def _intact(file: ListedFile, found: StoredObject | None, completed: StoredObject) -> bool:
    return found is not None and found.size == file.bytes and found.changed_ns <= completed.changed_ns


class PublishedEntry(ManifestEntry):
    """A file of the results, and its object below the prefix."""

    file: PlainName
    sha256: Digest
    stage: PlainName
    key: Digest

    @computed_field  # type: ignore[prop-decorator]
    @property
    def object(self) -> str:
        """Name of its object, relative to the prefix."""
        return object_of(self.stage, self.key, self.sha256, self.file)


class PublishedManifest(Manifest):
    """The content of manifest.json on object storage.

    Attributes
    ----------
    artifacts : by name, the files of the results with their objects.
    summary : what is in summary.json of the same run.
    """

    artifacts: Mapping[str, PublishedEntry]
    summary: Summary

    def of_folder(self) -> Manifest:
        """The manifest that the same results have in an output folder."""
        return Manifest.model_validate(self.model_dump())


_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class ObjectWorkspace:
    """A `tasks.store.remote.Remote` on object storage: finished outputs for every machine, and results.

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
        """Check that the storage answers and grants access."""
        self.storage.require_access()

    def take(self, key: StageKey, folder: Path) -> float | None:
        """Download the output of a stage; see `tasks.store.remote.Remote`."""
        listing = self.storage.document(f"{folder_of(key.stage, key.digest)}/{STAGE_FILE}", StageListing)
        if listing is None or (listing.stage, listing.key) != (key.stage, key.digest):
            return None
        for file in listing.files:
            if self.storage.download(listing.object_of(file), folder / file.file) != file.sha256:
                _log.warning("%s: %s in %s is damaged", key.stage, file.file, self.storage.address)
                return None
        return listing.seconds

    def put(self, key: StageKey, folder: Path) -> None:  # noqa: ARG002
        """Upload a stage output, its list of files last."""
        listing = _listing(folder)
        self._put_files(listing, listing.files, folder)

    def put_missing(self, key: StageKey, folder: Path) -> None:
        """Upload the parts of a stage output that are missing or changed by name, size or time."""
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
        return self.storage.document(MANIFEST, PublishedManifest)

    def publish(
        self, manifest: Mapping[str, JSON], summary: Mapping[str, JSON], own: Collection[str]
    ) -> None:
        """Point to the results of a run; see `tasks.store.remote.Remote`."""
        published = PublishedManifest.model_validate({**manifest, "summary": summary})
        last = self.manifest()
        if last is not None:
            published = published.beside(last, own)
        self.tell(summary)
        self._put_json(MANIFEST, published.to_json())
        _log.info("published at %s", self.storage.address)

    def tell(self, summary: Mapping[str, JSON]) -> None:
        """Record how a run ended; the results that the manifest refers to remain unchanged."""
        self._put_json(SUMMARY, summary)

    def _put_json(self, name: str, content: JSON) -> None:
        self.storage.put(name, (json_text(content, indent=2) + "\n").encode())


def _listing(folder: Path) -> StageListing:
    """The files of a finished output of this machine."""
    return StageListing.model_validate(from_json((folder / STAGE_FILE).read_bytes()))
