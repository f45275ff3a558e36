"""References to finished files, which stages pass to each other instead of tables.

An artifact is a path together with the digest of the bytes that were written there. Who reads it
checks the digest first, so a file that was changed behind our back is noticed and never used.
"""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from tasks.files.installation import InstallationError

# Of files by where they lie, size, and times of change.
_DIGESTS: dict[tuple[int, ...], str] = {}
# The clock of a file system is not finer than some milliseconds; that of some counts seconds.
_TICK_NS, _SECOND_NS = 15_000_000, 1_000_000_000


@dataclass(frozen=True)
class Artifact:
    """A finished, immutable file.

    Attributes
    ----------
    name : the file's stem, e.g. ``object_points``; see `artifact_names`.
    path : where it lies.
    sha256 : digest of its bytes, hexadecimal.
    rows : number of rows of a Parquet table, None for other files.
    """

    name: str
    path: Path
    sha256: str
    rows: int | None


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal; read in pieces, so size does not matter."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def forget_digests() -> None:
    """Read every file again; a run trusts only what it has read itself."""
    _DIGESTS.clear()


def digest_of_unchanged(path: Path) -> str:
    """SHA-256 of a file, hexadecimal; read again only if it has changed since this run read it."""
    status = path.stat()
    stamp = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
    if stamp not in _DIGESTS:
        digest = digest_of_file(path)
        # The next change of a file that has only just changed may have the same time.
        if time.time_ns() - status.st_ctime_ns < _tick_ns(status.st_ctime_ns):
            return digest
        _DIGESTS[stamp] = digest
    return _DIGESTS[stamp]


def _tick_ns(changed_ns: int) -> int:
    return _SECOND_NS if changed_ns % _SECOND_NS == 0 else _TICK_NS


def artifact_of(path: Path, name: str | None = None) -> Artifact:
    """Describe a finished file: digest and, for a Parquet table, the number of rows."""
    return Artifact(path.stem if name is None else name, path, digest_of_unchanged(path), _rows(path))


def artifact_names(files: Collection[str]) -> dict[str, str]:
    """Name of the artifact in each file of one output: its stem, or the whole name where stems are alike.

    A document in several forms (``certificate.html``, ``certificate.pdf``) so has a name for each of them.
    """
    stems = Counter(Path(file).stem for file in files)
    return {file: Path(file).stem if stems[Path(file).stem] == 1 else file for file in files}


def verified(artifact: Artifact) -> Path:
    """The artifact's path, after its bytes were checked against the digest.

    Raises
    ------
    InstallationError
        If the file is missing or its bytes are not the ones that were written.
    """
    if not artifact.path.is_file():
        raise InstallationError(
            f"The intermediate result {artifact.path} is missing.",
            "Run again: the stage that made it is then recomputed.",
        )
    if digest_of_unchanged(artifact.path) != artifact.sha256:
        raise InstallationError(
            f"The intermediate result {artifact.path} was changed after it had been written.",
            "Run again: the stage that made it is then recomputed. Published files are copies to work with; "
            "those under .store must stay as they are.",
        )
    return artifact.path


def _rows(path: Path) -> int | None:
    if path.suffix != ".parquet":
        return None
    # Imported here because digests alone (the command line's start) need no Parquet reader.
    import pyarrow.parquet as pq

    return int(pq.read_metadata(path).num_rows)
