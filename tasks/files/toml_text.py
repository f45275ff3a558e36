"""TOML as it is written here: tables of plain values, in the order given."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

TomlValue: TypeAlias = "str | int | float | bool | Sequence[TomlValue] | Mapping[str, TomlValue]"


def toml_text(content: Mapping[str, TomlValue]) -> str:
    """Write tables as TOML; a sequence of tables becomes an array of tables.

    Raises
    ------
    TypeError
        If there is a value that TOML cannot hold.
    """
    return "\n".join(_table((), content)).lstrip("\n") + "\n"


def _table(path: tuple[str, ...], table: Mapping[str, TomlValue]) -> Iterator[str]:
    """Lines of a table without its header: plain values first, then the tables in it."""
    for key, value in table.items():
        if not _is_table(value) and not _is_tables(value):
            yield f"{toml_key(key)} = {toml_value(value)}"
    for key, value in table.items():
        inner = (*path, key)
        name = ".".join(map(toml_key, inner))
        if isinstance(value, Mapping):
            # A table of tables needs no header of its own.
            if not value or not all(isinstance(item, Mapping) for item in value.values()):
                yield f"\n[{name}]"
            yield from _table(inner, value)
        elif _is_tables(value):
            for item in value:  # type: ignore[union-attr]
                assert isinstance(item, Mapping)
                yield f"\n[[{name}]]"
                yield from _table(inner, item)


def _is_table(value: TomlValue) -> bool:
    return isinstance(value, Mapping)


def _is_tables(value: TomlValue) -> bool:
    """Whether it is a non-empty sequence of tables."""
    return (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and len(value) > 0
        and all(isinstance(item, Mapping) for item in value)
    )


def toml_key(key: str) -> str:
    """A key, in quotes where it needs them."""
    plain = key and all(
        character.isascii() and (character.isalnum() or character in "-_") for character in key
    )
    return key if plain else _text(key)


def _text(text: str) -> str:
    # TOML's basic strings know the escapes of JSON, but not a bare DEL.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_value(value: TomlValue) -> str:
    """A value in one line; a table is in braces."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
    raise TypeError(f"{type(value).__name__} cannot be written in TOML")
