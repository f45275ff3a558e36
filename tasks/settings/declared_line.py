"""A project as it would be with one line of its file changed, or without one of its files."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from tasks.settings.base import Settings
from tasks.settings.project import Project

Kind = Literal["image_points", "exposures", "control"]
_KINDS: tuple[Kind, ...] = ("image_points", "exposures", "control")


@dataclass(frozen=True)
class InputTable:
    """The table of one input file.

    Attributes
    ----------
    kind : of the input.
    number : from 0 among those of its kind.
    several : whether there are others of its kind.
    """

    kind: Kind
    number: int
    several: bool

    @property
    def name(self) -> str:
        """As it is in front of its keys, ``inputs.control`` or ``inputs.control.1``."""
        return f"inputs.{self.kind}{f'.{self.number}' if self.several else ''}"

    def without(self, project: Project) -> Project | None:
        """The project without this file; None if nothing could be judged then."""
        others = tuple(
            source
            for number, source in enumerate(getattr(project.inputs, self.kind))
            if number != self.number
        )
        if not others and self.kind != "control":
            return None
        return _changed(project, ("inputs", self.kind), others)


def input_table(project: Project, file: Path | None) -> InputTable | None:
    """The table that names a file; None if no input does."""
    for kind in _KINDS:
        sources = getattr(project.inputs, kind)
        for number, source in enumerate(sources):
            if source.file == file:
                return InputTable(kind, number, len(sources) > 1)
    return None


def with_declared(project: Project, table: InputTable, line: str) -> Project | None:
    """The project with ``key = value`` in a table; None if that cannot be."""
    sources = list(getattr(project.inputs, table.kind))
    keys, value = _parsed(line)
    try:
        sources[table.number] = _with(sources[table.number], keys, value)
        return _changed(project, ("inputs", table.kind), tuple(sources))
    except (ValidationError, AttributeError):
        return None


def _parsed(line: str) -> tuple[tuple[str, ...], object]:
    """Keys and value of a line; a table in braces is a value."""
    inner: Any = tomllib.loads(line)
    path = line.split("=", 1)[0].strip().split(".")
    for key in path:
        inner = inner[key]
    return tuple(path), inner


def _changed(project: Project, keys: tuple[str, ...], value: object) -> Project:
    changed = _with(project, keys, value)
    assert isinstance(changed, Project)
    return changed.read_from(project.source)


def _with(settings: Settings, keys: tuple[str, ...], value: object) -> Settings:
    """The same settings, validated again, with a value in a table inside them."""
    inner = value if len(keys) == 1 else _with(getattr(settings, keys[0]), keys[1:], value)
    given = {name: getattr(settings, name) for name in settings.model_fields_set}
    return type(settings).model_validate({**given, keys[0]: inner})
