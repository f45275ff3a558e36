"""Read a TOML file of settings: ``--set`` values, validation, and errors that name key and line."""

from __future__ import annotations

import copy
import hashlib
import json
import re
import tomllib
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, cast

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from tasks.errors import InputError, Location
from tasks.files.delivered_file import is_there, read_delivered
from tasks.nearest_name import did_you_mean, nearest
from tasks.plain_text import quoted, trouble_in_tables, visible
from tasks.settings.base import PathContext, Settings, meaning_of
from tasks.settings.declare import refuse_open_values
from tasks.settings.key_lines import line_nested_deeper, line_of_key

Table = dict[str, Any]
Keys = tuple[str | int, ...]

# Tables lie five deep at most.
_DEEPEST = 30
# A list of names of check points is the longest value there is; what --set replaces is shorter than a file.
_LONGEST_OVERRIDE = 100_000
_SHOWN = 80
_MOST_FILES = 3
_READABLE = "Write ordinary characters, and numbers of possible size."


@dataclass(frozen=True)
class SettingsKind:
    """A kind of settings file.

    Attributes
    ----------
    model : what it must hold.
    name : what messages call it, "project file".
    page : the page that lists its keys.
    """

    model: type[Settings]
    name: str
    page: str


@dataclass(frozen=True)
class SettingsFile:
    """A settings file as written, before it is validated.

    Attributes
    ----------
    kind : what it should be.
    path : where it was read from.
    text : as written.
    content : the parsed tables, with values replaced by ``--set``.
    sha256 : digest of the bytes the text was read from, hexadecimal.
    said : what the user wrote for each replaced key, for messages.
    """

    kind: SettingsKind
    path: Path
    text: str
    content: Table
    sha256: str = ""
    said: dict[tuple[str, ...], str] = field(default_factory=dict)

    def replace(self, overrides: Sequence[str]) -> None:
        """Put texts ``a.b.c=VALUE`` into the content; VALUE is parsed as TOML, else taken as text.

        Raises
        ------
        InputError
            If the text is not an assignment, or the key one that such a file does not have.
        """
        for override in overrides:
            keys, said = _apply(self.content, override, self.kind)
            self.said[keys] = said

    def changed(self, changes: Mapping[str, object], said: str, without: str) -> SettingsFile:
        """A file that differs in some values and lacks one table; `said` opens the messages.

        Raises
        ------
        InputError
            If a key is not one that such a file can have.
        """
        content = {key: value for key, value in copy.deepcopy(self.content).items() if key != without}
        for key, value in changes.items():
            _put(content, key, copy.deepcopy(value), f"{said}: {key}", self.kind)
        return replace(self, content=content)

    def validated(self, context: PathContext) -> Settings:
        """The settings, an instance of the kind's model.

        Raises
        ------
        InputError
            With the file, the line and the key: an unknown or missing key, a value that cannot be, or that is
            still to be declared.
        """
        refuse_open_values(self.content, self.text, self.path)
        try:
            return self.kind.model.model_validate(self.content, context=context)
        except ValidationError as error:
            errors = error.errors()
            # A misspelt key is also a missing one; the misspelling is what helps.
            first = next((entry for entry in errors if entry["type"] == "extra_forbidden"), errors[0])
            raise _input_error(first, self) from error


def read_settings_file(path: Path, kind: SettingsKind, *, links: bool = True) -> SettingsFile:
    """Read and parse a file.

    Parameters
    ----------
    links : whether links on the path are followed; not if where it lies has been checked already.

    Raises
    ------
    InputError
        If there is no such file, it is not TOML in UTF-8, too large, nested too deeply, or holds a text
        nobody can read.
    """
    if not is_there(path):
        raise Location(path).error(f"There is no such {kind.name}.", "Check the path.")
    if path.is_dir():
        inside = ", ".join(visible(file.name, _SHOWN) for file in sorted(path.glob("*.toml"))[:_MOST_FILES])
        remedy = f"Name the file in it: {inside}." if inside else "There is none in it."
        raise Location(path).error(f"This is a folder, not a {kind.name}.", remedy)
    read = read_delivered(path.resolve() if links else path, "settings")
    try:
        text = read.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Location(path).error(f"The {kind.name} is not UTF-8 text.", "Save it as UTF-8.") from error
    content = _parsed(text, path)
    _require_readable(content, text, path)
    return SettingsFile(kind, path, text, content, hashlib.sha256(read).hexdigest())


def _require_readable(content: Table, text: str, path: Path) -> None:
    found = trouble_in_tables(content)
    if found is not None:
        place, trouble = found
        name = ".".join(map(str, place)) or None
        raise Location(path, line_of_key(text, place), name).error(trouble, _READABLE)


def _parsed(text: str, path: Path) -> Table:
    deep = line_nested_deeper(text, _DEEPEST)
    if deep is not None:
        raise Location(path, deep).error("The tables are nested too deeply.", "Correct the line.")
    try:
        return tomllib.loads(text)
    except ValueError as error:
        found = re.search(r"\(at line (\d+), column \d+\)", str(error))
        what = re.sub(r"\s*\(at .*\)$", "", str(error))
        raise Location(path, int(found.group(1)) if found else None).error(
            f"This is not valid TOML: {what}.", "Correct the line; text values must be in quotes."
        ) from error


def _apply(content: Table, override: str, kind: SettingsKind) -> tuple[tuple[str, ...], str]:
    """Put one ``a.b.c=VALUE`` into the content; the key must be one such a file can have."""
    key_text, equals, value_text = override.partition("=")
    said = f"--set {visible(override, _SHOWN)}"
    if not equals:
        raise InputError(f"{said} has no value.", "Write --set KEY=VALUE.")
    if len(override) > _LONGEST_OVERRIDE or line_nested_deeper(override, _DEEPEST) is not None:
        raise InputError(f"{said}: this is too long, or nested too deeply.", "Write it into the file.")
    # A line break would begin another key.
    parsed = _loads(f"value = {value_text}") if "\n" not in value_text else {}
    value = parsed.get("value", value_text)
    found = trouble_in_tables(value)
    if found is not None:
        raise InputError(f"{said}: {found[1]}", _READABLE)
    return _put(content, key_text, value, said, kind), said


def _loads(text: str) -> Table:
    """The tables of a short text; none if it is not TOML, or holds a number without end."""
    try:
        return tomllib.loads(text)
    except ValueError:
        return {}


def _put(content: Table, key_text: str, value: object, said: str, kind: SettingsKind) -> tuple[str, ...]:
    """Put a value under a dotted key, which is returned; `said` is what the user wrote, for messages."""
    keys = _keys_of(_loads(f"{key_text.strip()} = 0"))
    if not keys or "\n" in key_text.strip():
        raise InputError(
            f"{said}: this is not a key.", "Write it with dots, as in adjustment.max_iterations=10."
        )
    _check_key(keys, content, said, kind)
    table: Any = content
    for key in keys[:-1]:
        table = _inner(table, key, said)
    table[_index(table, keys[-1], said)] = value
    return keys


def _keys_of(nested: Table) -> tuple[str, ...]:
    keys = []
    inner: Any = nested
    while isinstance(inner, dict) and inner:
        key, inner = next(iter(inner.items()))
        keys.append(key)
    return tuple(keys)


def _inner(table: Any, key: str, said: str) -> Any:
    position = _index(table, key, said)
    if isinstance(table, dict) and not isinstance(table.get(position), dict | list):
        # "ellipsoidal", "none": a value that stands for a table gives way to the table.
        table[position] = {}
    return table[position]


def _index(table: Any, key: str, said: str) -> Any:
    if isinstance(table, dict):
        return key
    if _is_index(key, table):
        return int(key)
    last = len(table) - 1
    raise InputError(
        f"{said}: these are numbered tables, and {quoted(key)} is not one of them.",
        f"Give its number, 0{f' to {last}' if last else ''}, as in inputs.image_points.0.sigma=0.3.",
    )


def _check_key(keys: Sequence[str], content: Table, said: str, kind: SettingsKind) -> None:
    """Refuse a key that no such file has; tables with free names (cameras) must exist already."""
    model: Any = kind.model
    table: Any = content
    for depth, key in enumerate(keys):
        if not (isinstance(table, list) and key.isdecimal()):
            known = _known_keys(model, table)
            if key not in known:
                place = visible(".".join(keys[:depth]), _SHOWN) or f"the {kind.name}"
                raise InputError(
                    f"{said}: there is no key {quoted(key)} in {place}.", did_you_mean(key, known)
                )
            model = _model_below(model, key)
        table = _below(table, key)


def _known_keys(model: Any, table: Any) -> list[str]:
    """The keys a table of this type can have; those it has if names are free; none for a plain value."""
    if isinstance(model, type) and issubclass(model, Settings):
        return list(model.model_fields)
    if typing.get_origin(model) is dict and isinstance(table, dict):
        return list(table)
    return []


def _below(table: Any, key: str | int) -> Any:
    if isinstance(table, dict):
        return table.get(str(key))
    if isinstance(table, list) and _is_index(str(key), table):
        return table[int(key)]
    return None


def _is_index(key: str, table: Sequence[object]) -> bool:
    return key.isdecimal() and len(key) < 10 and int(key) < len(table)


def _model_below(model: Any, key: str | int) -> Any:
    """The type of a field (or item) of a settings model, without Optional, Annotated and tuple around it."""
    if isinstance(model, type) and issubclass(model, Settings):
        field = model.model_fields.get(str(key))
        return _unwrapped(field.annotation) if field is not None else None
    if typing.get_origin(model) is dict:
        return _unwrapped(typing.get_args(model)[1])
    return model


def _unwrapped(annotation: Any) -> Any:
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return _unwrapped(typing.get_args(annotation)[0])
    if origin in (Union, UnionType):
        inner = [item for item in typing.get_args(annotation) if item is not type(None)]
        return _unwrapped(inner[0]) if len(inner) == 1 else annotation
    if origin is tuple:
        return _unwrapped(typing.get_args(annotation)[0])
    return annotation


def _input_error(error: ErrorDetails, source: SettingsFile) -> InputError:
    """Turn pydantic's first complaint into a sentence with key, line and remedy."""
    keys = _shown_keys(error["loc"], source.content)
    name = ".".join(str(key) for key in keys)
    line = line_of_key(source.text, keys)
    if error["type"] == "extra_forbidden":
        known = list(cast(type[Settings], _model_at(error["loc"][:-1], source.kind)).model_fields)
        place = ".".join(map(str, keys[:-1]))
        where = f"in [{place}]" if place else f"in the {source.kind.name}"
        what, remedy = f"There is no key '{keys[-1]}' {where}.", did_you_mean(str(keys[-1]), known)
    elif error["type"] == "missing" and isinstance(error["loc"][-1], int):
        what, remedy = f"Number {int(error['loc'][-1]) + 1} of this list is missing.", _page_of(source)
    elif error["type"] == "missing":
        what, remedy = f"The key '{name}' is missing.", _remedy_for_missing(error["loc"], source.kind)
        line = line_of_key(source.text, keys[:-1])
    elif error["type"] == "aerocal":
        what, remedy = str(error["ctx"]["what"]), str(error["ctx"]["remedy"])
    elif error["type"] == "tuple_type":
        what = f"The value {_shown(error['input'])} is not a list."
        remedy = f"Write it in brackets: [{_shown(error['input'])}]."
    elif error["type"].startswith("date_"):
        what = f"The value {_shown(error['input'])} is not a day."
        remedy = "Write year, month and day without a time, such as 2020-12-24."
    elif error["type"] == "model_type":
        what = f"The value {_shown(error['input'])} is not a table."
        known = list(cast(type[Settings], _model_at(error["loc"], source.kind)).model_fields)
        remedy = f"Write {{ KEY = VALUE }} with keys of: {', '.join(known)}."
    else:
        what = f"The value {_shown(error['input'])} is not allowed here: {error['msg']}."
        words = re.findall("'([^']+)'", error["ctx"]["expected"]) if error["type"] == "literal_error" else []
        meant = nearest(str(error["input"]), words)
        remedy = f"Did you mean '{meant}'?" if meant else _page_of(source)
    texts = tuple(map(str, keys))
    said = next((text for given, text in source.said.items() if texts[: len(given)] == given), None)
    if said is not None:
        trouble = _trouble_of_toml(error["input"])
        return InputError(*(trouble or (what, remedy)), entity=said)
    return InputError(what, remedy, source.path, line, name or None)


def _trouble_of_toml(value: object) -> tuple[str, str] | None:
    """What is wrong with a value that was meant as a table or list and taken as text, and the remedy."""
    if not isinstance(value, str) or not value.lstrip().startswith(("{", "[")):
        return None
    key = "value = "
    try:
        tomllib.loads(f"{key}{value}")
    except ValueError as error:
        what = re.sub(
            r"line 1, column (\d+)\)$", lambda found: f"character {int(found[1]) - len(key)})", str(error)
        ).replace("end of document", "its end")
        return (
            f"The value is not valid TOML: {what}.",
            "Texts in it must be in quotes, a key is followed by =, and quotes of the shell go around the "
            "whole: --set 'KEY=VALUE'.",
        )
    return None


def _model_at(location: Keys, kind: SettingsKind) -> Any:
    """The type of what is at a place of the file."""
    model: Any = kind.model
    for key in location:
        model = model if isinstance(key, int) else _model_below(model, key)
    return model


def _shown(value: object) -> str:
    """A value as it was written, if that is short."""
    return visible(json.dumps(value, default=str, ensure_ascii=False), _SHOWN)


def _page_of(source: SettingsFile) -> str:
    return f"Correct it; {source.kind.page} lists every key with its unit."


def _shown_keys(location: Keys, content: Table) -> Keys:
    """The keys as the user wrote them: no index for a single table."""
    shown: list[str | int] = []
    table: Any = content
    for key in location:
        if isinstance(key, int) and isinstance(table, dict):
            continue
        shown.append(key)
        table = _below(table, key)
    return tuple(shown)


def _remedy_for_missing(location: Keys, kind: SettingsKind) -> str:
    """The remedy in the description of the missing field."""
    model = _model_at(location[:-1], kind)
    key = str(location[-1])
    known = key in cast(type[Settings], model).model_fields
    meaning = meaning_of(model, key) if known else ""
    return f"Add it: {meaning}" if meaning else "Add it."
