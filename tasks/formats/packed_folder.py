"""Folders that are delivered as one zip file: nothing is unpacked, and its members are read one by one."""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from tasks.errors import Location
from tasks.files.delivered_file import file_limits
from tasks.formats.text_table import read_bytes

_SIGNATURE, _ENTRY = b"PK\x03\x04", b"PK\x01\x02"
# An entry of 46 bytes is an object of some hundred.
_MOST_MEMBERS = 300_000
#: What damaged archives end in.
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError,
    LookupError, MemoryError, OverflowError,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PackedFolder:
    """Members of a zip file by their names, in its order."""

    file: Path
    archive: zipfile.ZipFile
    members: dict[str, zipfile.ZipInfo]

    def read(self, name: str) -> bytes:
        """The content of a member.

        Raises
        ------
        InputError
            If there is none, it is damaged, or larger than a document.
        """
        info = self.members.get(name)
        if info is None:
            raise Location(self.file, entity=name).error(
                "The packed folder lacks a file.", "Pack the whole folder."
            )
        trouble = file_limits().trouble(self.file, info.file_size, "document")
        if trouble is not None:
            raise trouble
        try:
            return self.archive.read(info)
        except _DAMAGE as error:
            raise Location(self.file, entity=name).error(
                "A member of the packed folder cannot be read.", "Pack the folder again."
            ) from error

    def beside(self, name: str, uri: str) -> str:
        """The name of a member to which another one refers by a relative address."""
        parts: list[str] = []
        relative = PurePosixPath(unquote(uri).replace("\\", "/"))
        for part in [*PurePosixPath(name).parent.parts, *relative.parts]:
            parts = parts[:-1] if part == ".." else [*parts, part]
        return "/".join(parts)


def is_packed(content: bytes) -> bool:
    """Whether bytes are those of a zip file."""
    return content.startswith(_SIGNATURE)


def packed_folder(path: Path, content: bytes | None = None) -> PackedFolder:
    """The members of a zip file.

    Raises
    ------
    InputError
        If it is none, or has more members than a folder of any delivery.
    """
    content = read_bytes(path) if content is None else content
    if not is_packed(content):
        raise Location(path).error(
            "This is not a zip file.", "Pack the folder into one zip file, and deliver that."
        )
    if content.count(_ENTRY) > _MOST_MEMBERS:
        raise Location(path).error(
            f"The packed folder has more than {_MOST_MEMBERS:,} files.", "Pack only the required files."
        )
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        members = {info.filename: info for info in archive.infolist() if not info.is_dir()}
    except _DAMAGE as error:
        raise Location(path).error("The zip file is damaged.", "Pack the folder again.") from error
    return PackedFolder(path, archive, members)
