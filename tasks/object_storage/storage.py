"""Objects below one address: list, read, put, download.

Every object appears at once or not at all: its whole content is handed over in one call, so nothing that
interrupts the process between two pieces can leave a part of it under its name. There is no lock, no rename
and no deletion.
"""

from __future__ import annotations

import hashlib
import logging
import mimetypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import BaseModel

from tasks.files.json_text import from_json
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.connection import connection_from, patiently

if TYPE_CHECKING:
    from pyarrow.fs import S3FileSystem

R = TypeVar("R")
D = TypeVar("D", bound=BaseModel)
_PIECE_BYTES = 1 << 22
#: Larger documents than this are not ours.
_MOST_BYTES = 64 << 20
_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class StoredObject:
    """An object in a listing.

    Attributes
    ----------
    size : bytes.
    changed_ns : when it was put there, by the clock of the storage; ns, most storages round to seconds.
    """

    size: int
    changed_ns: int


@dataclass(frozen=True)
class ObjectStorage:
    """The objects below an address; names are relative to it.

    Every method tries again while the storage does not answer (`tasks.object_storage.connection`), and raises
    InstallationError when it has not answered for too long, or refuses.
    """

    address: ObjectAddress

    def require_access(self) -> None:
        """Ask for a listing: the only request whose refusal says whether bucket, key or region is wrong."""
        self.listing("")

    def listing(self, folder: str) -> dict[str, StoredObject]:
        """The objects below a folder, by the rest of their names; for the prefix only the direct ones."""
        path = self.address.path_of(folder).rstrip("/")

        def request(files: S3FileSystem) -> dict[str, StoredObject]:
            from pyarrow.fs import FileSelector, FileType

            # With allow_not_found a missing bucket would pass for an empty folder.
            found = files.get_file_info(FileSelector(path, recursive=bool(folder)))
            return {
                info.path.removeprefix(f"{path}/"): StoredObject(info.size, info.mtime_ns)
                for info in found
                if info.type == FileType.File
            }

        try:
            return self._tried(request)
        except FileNotFoundError:
            return {}

    def read(self, name: str, most_bytes: int) -> bytes | None:
        """The content of a small object; None if there is none, or it is too large."""

        def request(files: S3FileSystem) -> bytes:
            with files.open_input_stream(self.address.path_of(name)) as stream:
                return bytes(stream.read(most_bytes + 1))

        try:
            content = self._tried(request)
        except FileNotFoundError:
            return None
        return content if len(content) <= most_bytes else None

    def document(self, name: str, kind: type[D]) -> D | None:
        """A document that may be replaced at any moment: the old one or the new one; None if there is none.

        The client asks for the size first, then for so many bytes. Of a longer document that took the place
        in between it gets a part, which cannot be parsed; then it is read again.

        Parameters
        ----------
        kind : of the document.
        """
        before: bytes | None = None
        while (content := self.read(name, _MOST_BYTES)) is not None:
            try:
                return kind.model_validate(from_json(content))
            except ValueError:
                if content == before:
                    _log.warning("%s/%s is damaged", self.address, name)
                    return None
                before = content
        return None

    def put(self, name: str, content: bytes) -> None:
        """Store an object, replacing an existing one."""
        self._tried(lambda files: self._put(files, name, content))

    def upload(self, path: Path, name: str) -> None:
        """Upload a file; a large one is sent in parts that appear together, as one object."""

        def request(files: S3FileSystem) -> None:
            import pyarrow as pa

            with pa.memory_map(str(path)) as content:
                self._put(files, name, content.read_buffer())

        self._tried(request)

    def download(self, name: str, path: Path) -> str | None:
        """Write an object into a file and return the digest of what was written; None if there is none."""

        def request(files: S3FileSystem) -> str:
            digest = hashlib.sha256()
            with files.open_input_stream(self.address.path_of(name)) as stream, path.open("wb") as file:
                while piece := stream.read(_PIECE_BYTES):
                    digest.update(piece)
                    file.write(piece)
            return digest.hexdigest()

        try:
            return self._tried(request)
        except FileNotFoundError:
            return None

    def _put(self, files: S3FileSystem, name: str, content: object) -> None:
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        stream = files.open_output_stream(self.address.path_of(name), metadata={"Content-Type": kind})
        stream.write(content)
        stream.close()

    def _tried(self, request: Callable[[S3FileSystem], R]) -> R:
        connection = connection_from()
        files = connection.filesystem()
        return patiently(lambda: request(files), self.address, connection.patience_s)
