"""Extensions by other installed packages: observation types, sets of additional parameters, file formats.

A package offers them as entry points of the groups ``aerocal.KIND``
(https://packaging.python.org/specifications/entry-points/). They are loaded when they are used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Literal, TypeAlias, TypeVar, cast, get_args

from adjust.errors import ExtensionError

Kind: TypeAlias = Literal[
    "cameras",
    "control_points",
    "distances",
    "exposures",
    "image_points",
    "observations",
    "parameter_sets",
]

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Extension:
    """Something that an installed package adds.

    Attributes
    ----------
    kind, name : what it is, and the name by which a project file asks for it.
    distribution, version : of the package.
    module : where it stands.
    """

    kind: Kind
    name: str
    distribution: str
    version: str
    module: str
    _point: EntryPoint

    def load(self) -> object:
        """Import it.

        Raises
        ------
        ExtensionError : that fails.
        """
        try:
            return self._point.load()
        except Exception as error:
            raise ExtensionError(
                self._names, f"cannot be loaded: {type(error).__name__}: {error}."
            ) from error

    @property
    def _names(self) -> str:
        return f"{self.name!r} ({self.kind}) of the package {self.distribution} {self.version}"

    def refused(self, why: str) -> ExtensionError:
        """The error for one that is not what it should be; a clause without subject."""
        return ExtensionError(self._names, why)


@cache
def installed_extensions() -> tuple[Extension, ...]:
    """All extensions of this environment, by kind and name.

    Raises
    ------
    ExtensionError : two packages add the same.
    """
    offered = entry_points()
    found: dict[tuple[str, str], Extension] = {}
    for kind in get_args(Kind):
        for point in offered.select(group=f"aerocal.{kind}"):
            package = point.dist
            name, version = ("?", "?") if package is None else (package.name, package.version)
            extension = Extension(kind, point.name, name, version, point.module, point)
            before = found.setdefault((kind, point.name), extension)
            if (before.distribution, before.module) != (name, point.module):
                raise extension.refused(f"is also added by {before.distribution}. Uninstall one of them.")
    return tuple(found[key] for key in sorted(found))


class Extended(Mapping[str, _Value]):
    """A register of what this program has and what extensions add; these are loaded when they are requested.

    Parameters
    ----------
    kind : of the extensions.
    own : what this program has; an extension of such a name is refused.
    trouble : what is wrong with a loaded extension, a clause without subject, by its name and itself; None:
        nothing.
    """

    def __init__(
        self, kind: Kind, own: Mapping[str, _Value], trouble: Callable[[str, object], str | None]
    ) -> None:
        self._kind, self._own, self._trouble = kind, own, trouble

    @property
    def own(self) -> Mapping[str, _Value]:
        """What this program has."""
        return self._own

    def _extensions(self) -> dict[str, Extension]:
        found = {item.name: item for item in installed_extensions() if item.kind == self._kind}
        for name, item in found.items():
            if name in self._own:
                raise item.refused(
                    "has a name that aerocal uses itself. Uninstall it, or ask its author to rename it."
                )
        return found

    def __getitem__(self, name: str) -> _Value:
        if name in self._own:
            return self._own[name]
        extension = self._extensions()[name]
        value = extension.load()
        trouble = self._trouble(name, value)
        if trouble is not None:
            raise extension.refused(trouble)
        return cast(_Value, value)

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._extensions()

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._extensions()

    def __len__(self) -> int:
        return len(self._own) + len(self._extensions())


def trouble_of_function(_name: str, value: object) -> str | None:
    """Why an object that must be a function is not valid."""
    return None if callable(value) else f"is a {type(value).__name__}, not a function."
