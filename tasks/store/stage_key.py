"""The key of a stage's output: everything the output depends on, and nothing else.

Into it go the digests of the artifacts and input files, the settings the stage reads, the source
its function reaches and the versions of the libraries that matter. Paths, threads and the output
folder stay out: moving a delivery recomputes nothing, changing one byte of it does.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Protocol, runtime_checkable

from tasks.errors import Location
from tasks.files.delivered_file import changed, digest_of_delivered, is_there
from tasks.files.json_text import JSON, json_text
from tasks.store.artifact import Artifact
from tasks.store.known_sources import extension_versions, known_digest_of_sources

LIBRARIES = ("numpy", "scipy", "numba", "pyarrow", "pandas", "pyproj")


@runtime_checkable
class Keyed(Protocol):
    """Settings of a stage, which know what belongs in a key."""

    def key_content(self) -> JSON:
        """The settings as JSON, every path to an input file replaced by the digest of its content."""
        ...

    def input_files(self) -> tuple[Path, ...]:
        """The input files the settings point to."""
        ...


@dataclass(frozen=True)
class StageKey:
    """Name and key of one stage run.

    Attributes
    ----------
    stage : the stage's name.
    parts : what the key is made of; kept next to the output to explain why a stage was computed.
    """

    stage: str
    parts: Mapping[str, JSON]

    @cached_property
    def digest(self) -> str:
        """The key: SHA-256 of the stage's name and all parts, hexadecimal."""
        return hashlib.sha256(json_text({"stage": self.stage, "parts": self.parts}).encode()).hexdigest()


def stage_key(stage: str, function: Callable[..., object], arguments: Mapping[str, object]) -> StageKey:
    """Key of running `function` with `arguments`.

    Raises
    ------
    TypeError
        If an argument is of a kind whose content cannot be put into a key.
    """
    parts: dict[str, JSON] = {
        "arguments": {name: _content(name, value) for name, value in arguments.items()},
        "source": known_digest_of_sources(function),
        "versions": library_versions(),
    }
    return StageKey(stage, parts)


@cache
def library_versions() -> Mapping[str, str]:
    """Versions a numerical result may depend on: libraries, PROJ, Python's minor version, extensions."""
    import pyproj

    versions = {name: version(name) for name in LIBRARIES}
    versions["PROJ"] = pyproj.proj_version_str
    versions["python"] = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {**versions, **extension_versions()}


def differences(old: Mapping[str, JSON], new: Mapping[str, JSON]) -> tuple[str, ...]:
    """Which parts of two keys differ, in words: names of arguments and libraries, "source"."""
    found: list[str] = []
    for part in sorted({*old, *new}):
        before, now = old.get(part), new.get(part)
        if isinstance(before, Mapping) and isinstance(now, Mapping):
            found += [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
        elif before != now:
            found.append(part)
    return tuple(found)


def _content(name: str, value: object) -> JSON:
    """The part of an argument that belongs in the key, with a tag so that no two kinds can be confused."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, date):
        return {"date": value.isoformat()}
    if isinstance(value, Artifact):
        return {"artifact": value.sha256}
    if isinstance(value, tuple | list):
        return {"sequence": [_content(f"{name}[{i}]", item) for i, item in enumerate(value)]}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {"mapping": {key: _content(f"{name}[{key!r}]", item) for key, item in value.items()}}
    if isinstance(value, Keyed):
        return {"settings": value.key_content()}
    raise TypeError(
        f"argument {name!r} of a stage is a {type(value).__name__}: its content cannot be put into a key"
    )


@dataclass(frozen=True)
class InputFile:
    """A delivered file as it was when its stage began.

    Attributes
    ----------
    path : where it lies.
    sha256 : digest of its bytes.
    stamp : size in bytes, time of modification and of status change in ns.
    """

    path: Path
    sha256: str
    stamp: tuple[int, int, int]

    @classmethod
    def of(cls, path: Path) -> InputFile:
        """The file as it is now.

        Raises
        ------
        InputError
            If there is no such file, or it is refused by `tasks.files.delivered_file`.
        """
        if not is_there(path):
            raise Location(path).error("This input file does not exist.", "Check its path and run again.")
        stamp = _stamp(path)
        return cls(path, digest_of_delivered(path), stamp)

    def require_unchanged(self) -> None:
        """Refuse a result computed from a file that was written to meanwhile.

        Raises
        ------
        InputError
            If the file is gone or its content differs.
        """
        if not self._is_unchanged():
            raise changed(self.path)

    def _is_unchanged(self) -> bool:
        if not is_there(self.path):
            return False
        return _stamp(self.path) == self.stamp or digest_of_delivered(self.path) == self.sha256


def input_files(value: object) -> Iterator[Path]:
    """The input files that the settings among a stage's arguments point to."""
    if isinstance(value, Mapping):
        for item in value.values():
            yield from input_files(item)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from input_files(item)
    elif isinstance(value, Keyed):
        yield from value.input_files()


def _stamp(path: Path) -> tuple[int, int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns
