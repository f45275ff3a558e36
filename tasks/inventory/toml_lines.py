"""Single lines of a TOML file: values, and comments after or before them."""

from __future__ import annotations

from typing import cast

from tasks.files.toml_text import TomlValue, toml_key, toml_value
from tasks.plain_text import visible

_LONGEST = 300


def key_line(key: str, value: object, why: str = "") -> str:
    """``key = value  # why``."""
    line = f"{toml_key(key)} = {toml_value(cast(TomlValue, value))}"
    return f"{line}  {comment(why)}" if why else line


def table_line(*keys: str) -> str:
    """``[a.b]``."""
    return f"[{'.'.join(map(toml_key, keys))}]"


def comment(text: str) -> str:
    """``# text``; what files say must not begin another line."""
    return f"# {visible(text, _LONGEST)}"
