"""Entries of a file by their names: images that must not share one, and what a reader does not take over."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PureWindowsPath
from typing import TypeVar
from urllib.parse import unquote

from tasks.errors import Location
from tasks.plain_text import quoted, visible

_Camera = TypeVar("_Camera")
# Of what is not taken over, names that are shown, and their characters.
_MOST_NAMED, _LONGEST = 30, 60


def file_of_uri(uri: str) -> str:
    """The name of a file of a URI reference, with %20 for a blank; a page of the file is behind "#"."""
    path, mark, page = uri.partition("#")
    return f"{PureWindowsPath(unquote(path)).name}{mark}{page}"


class ImagesByName:
    """Which image of a file has a name: none may have that of another one, as files in two folders do.

    All images that may be used are named, with image points or not: one may have an orientation, and the
    other one the points.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._number: dict[str, object] = {}
        self._name: dict[object, str] = {}

    def named(self, name: str, number: object) -> str:
        """The name of the image of this number.

        Raises
        ------
        InputError
            If another one has it, or its number.
        """
        if self._number.setdefault(name, number) != number:
            raise Location(self._path, entity=name).error(
                f"Two images are called {quoted(name)}.",
                "Give their files (in Metashape their labels) different names: folders do not count.",
            )
        if self._name.setdefault(number, name) != name:
            raise Location(self._path, entity=name).error(
                f"{quoted(self._name[number])} has the same number, {number}.", "Export the images again."
            )
        return name


def take_camera(path: Path, cameras: dict[str, _Camera], name: str, camera: _Camera) -> None:
    """Add a camera of a file, which may be there again, to those by name.

    Raises
    ------
    InputError
        If another one has its name.
    """
    if cameras.setdefault(name, camera) != camera:
        raise Location(path, entity=name).error(
            "Two different cameras have this name: which of them took an image is not known.",
            "Give each camera a name of its own in the program that wrote the file.",
        )


class NotTaken:
    """What of a file a reader does not take over, by its names there; of very many, the first ones."""

    def __init__(self) -> None:
        self._count: dict[str, int] = {}

    def add(self, names: Iterable[str]) -> None:
        """Count these, too."""
        for name in names:
            shown = visible(name, _LONGEST)
            if shown in self._count or len(self._count) < _MOST_NAMED:
                self._count[shown] = self._count.get(shown, 0) + 1

    def remarks(self, path: Path) -> tuple[str, ...]:
        """A sentence on them with how often they are there; none if there are none."""
        listed = (f"{name} ({n:,})" if n > 1 else name for name, n in self._count.items())
        return (f"{path.name}: not taken over: {', '.join(listed)}.",) if self._count else ()
