"""stage.json of a stage output, as far as another machine needs it to take the output up."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from tasks.object_storage.storage import StoredObject
from tasks.storage.json_text import from_json
from tasks.storage.stage_key import StageKey

STORE = ".store"
STAGE_FILE = "stage.json"


def _plain(name: str) -> str:
    """A name that leads nowhere but into the folder it is put into."""
    if name in ("", ".", "..") or PurePosixPath(name).name != name or "\\" in name or "\0" in name:
        raise ValueError("not the plain name of a file")
    return name


#: What was read from the storage is checked like any delivery: a name there must not lead elsewhere here.
PlainName: TypeAlias = Annotated[str, AfterValidator(_plain), Field(max_length=200)]
Digest: TypeAlias = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def folder_of(stage: str, key: str) -> str:
    """Where the output of a stage lies."""
    return f"{STORE}/{stage}/{key}"


def object_of(stage: str, key: str, sha256: str, file: str) -> str:
    """Name of the object of a file: with its digest, so that whoever puts it there puts the same bytes."""
    return f"{folder_of(stage, key)}/{sha256}/{file}"


class ListedFile(BaseModel):
    """A file of a stage output: name, digest and size."""

    model_config = ConfigDict(frozen=True)

    file: PlainName
    sha256: Digest
    bytes: Annotated[int, Field(ge=0)]


class StageListing(BaseModel):
    """A finished stage output: which files, and the seconds it once took to compute them."""

    model_config = ConfigDict(frozen=True)

    stage: PlainName
    key: Digest
    files: tuple[ListedFile, ...]
    seconds: float

    def object_of(self, file: ListedFile) -> str:
        """Name of the object of one of the files."""
        return object_of(self.stage, self.key, file.sha256, file.file)

    def to_be_put(self, there: Mapping[str, StoredObject]) -> tuple[ListedFile, ...]:
        """The files whose objects are missing, or not as they were put there.

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


def stage_listing_from(content: bytes, key: StageKey) -> StageListing | None:
    """Read the list of files of a stage output; None if it is none, or that of another one."""
    try:
        listing = StageListing.model_validate(from_json(content))
    except ValueError:
        return None
    return listing if (listing.stage, listing.key) == (key.stage, key.digest) else None


def _intact(file: ListedFile, found: StoredObject | None, completed: StoredObject) -> bool:
    return found is not None and found.size == file.bytes and found.changed_ns <= completed.changed_ns
