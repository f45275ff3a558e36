"""Digests of sources, remembered from one process to the next as long as no source file has changed.

To follow the imports of a stage takes about a second, to look at the files ten milliseconds. What is
remembered applies to one listing of all folders of this application: names, sizes, numbers, times of
modification and of status change. The system alone sets the last, so a file that came with an old date is
seen as well. The listing is compared as a whole, because a new file may be what an import means from now on.

The installed extensions have digests of their own sources: results depend on them as on libraries.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import platformdirs

from adjust.errors import ExtensionError
from adjust.extensions import Extension, installed_extensions
from tasks.errors import InputError
from tasks.files.json_text import read_json, replace_json
from tasks.store.source_digest import PACKAGES, ROOT, digest_behind, source_of


def extension_versions() -> Mapping[str, str]:
    """Version and digest of the sources of every package that adds something, by its name.

    Raises
    ------
    InputError
        If two packages add the same.
    """
    try:
        found = installed_extensions()
    except ExtensionError as error:
        raise InputError(str(error), "Run again after that.") from error
    packages: dict[str, dict[str, str]] = {}
    for extension in found:
        packages.setdefault(f"{extension.distribution} {extension.version}", {}).update(_sources(extension))
    return {
        f"extension {name}": hashlib.sha256(repr(sorted(sources.items())).encode()).hexdigest()[:16]
        for name, sources in packages.items()
    }


def _sources(extension: Extension) -> dict[str, str]:
    """Digests of the Python files of the top-level package, or the module, that an extension is in."""
    top = extension.module.partition(".")[0]
    spec = find_spec(top)
    if spec is None or spec.origin is None:
        return {top: "missing"}
    origin = Path(spec.origin)
    files = sorted(origin.parent.rglob("*.py")) if spec.submodule_search_locations else [origin]
    return {
        f"{top}/{file.relative_to(origin.parent).as_posix()}": hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
    }


#: Names another folder for what is remembered.
SOURCES_VARIABLE = "AEROCAL_SOURCES_CACHE"
# A file may be written twice within one tick of the clock of its file system.
_SETTLED_NS = 2_000_000_000


def known_digest_of_sources(function: Callable[..., object]) -> str:
    """As `tasks.store.source_digest.digest_of_sources`, which is called only after a change."""
    start = source_of(function)
    if not any(start.is_relative_to(ROOT / package) for package in PACKAGES):
        # Nothing is remembered of folders that are not ours.
        return digest_behind(start)
    return _known(start)


@dataclass(frozen=True)
class _Listing:
    """All files in the folders of this application.

    Attributes
    ----------
    digest : SHA-256 of what the system says of them; of their content nothing was read.
    settled : whether the last change is so long ago that the next one will show.
    """

    digest: str
    settled: bool

    @classmethod
    def now(cls) -> _Listing:
        digest, newest_ns = hashlib.sha256(str(ROOT).encode()), 0
        for path, status in (item for package in PACKAGES for item in _files(ROOT / package)):
            stamp = (status.st_size, status.st_ino, status.st_mtime_ns, status.st_ctime_ns)
            digest.update(f"\0{path}\0{stamp}".encode())
            newest_ns = max(newest_ns, status.st_mtime_ns, status.st_ctime_ns)
        return cls(digest.hexdigest(), time.time_ns() - newest_ns > _SETTLED_NS)


def _files(folder: Path | str) -> Iterator[tuple[str, os.stat_result]]:
    """The files below a folder in a fixed order, except compiled Python files."""
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            if entry.is_dir():
                if entry.name != "__pycache__":
                    yield from _files(entry.path)
            else:
                yield entry.path, entry.stat()


def listing_of_sources() -> str:
    """Digest of what the system says of all files of this application; none of them is read."""
    return _Listing.now().digest


# Kept for the life of the process, as the digests themselves are.
@cache
def _known(start: Path) -> str:
    listing, place = _Listing.now(), _place()
    known = _remembered(place, listing)
    name = start.relative_to(ROOT).as_posix()
    if name not in known:
        known[name] = digest_behind(start)
        if listing.settled:
            _remember(place, listing, known)
    return known[name]


def _place() -> Path:
    """The cache file of this user and this installation."""
    named = os.environ.get(SOURCES_VARIABLE)
    parent = Path(named).absolute() if named else Path(platformdirs.user_cache_dir("aerocal")) / "sources"
    return parent / f"{hashlib.sha256(str(ROOT).encode()).hexdigest()[:16]}.json"


def _remembered(place: Path, listing: _Listing) -> dict[str, str]:
    """Digests by the name of the module file; none if something has changed since, or nothing can be read."""
    with contextlib.suppress(OSError, ValueError):
        content = read_json(place)
        if isinstance(content, dict) and content.get("listing") == listing.digest:
            return {str(name): str(digest) for name, digest in content["digests"].items()}
    return {}


def _remember(place: Path, listing: _Listing, known: dict[str, str]) -> None:
    # Where nothing can be written, the imports are followed every time.
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_json(place, {"listing": listing.digest, "digests": known})
