"""JSON as it is written here: one spelling for each content, without NaN and infinity."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, TypeAlias, cast

from tasks.plain_text import quoted

_LARGEST_BYTES = 1_000_000_000

JSON: TypeAlias = "str | int | float | bool | Sequence[JSON] | Mapping[str, JSON] | None"


def json_text(value: JSON, *, indent: int | None = None) -> str:
    """Write `value` as JSON with sorted keys; the same content always gives the same text.

    Raises
    ------
    TypeError
        If `value` holds something JSON has no word for.
    ValueError
        If it holds NaN or an infinite number.
    """
    return json.dumps(value, sort_keys=True, indent=indent, ensure_ascii=False, allow_nan=False)


def finite(value: JSON) -> JSON:
    """`value` with null for every NaN and infinite number: values that cannot be computed are missing."""
    if isinstance(value, float):
        # float() also frees a numpy scalar of its type.
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [finite(item) for item in value]
    return value


def attributes(item: object, *names: str) -> dict[str, JSON]:
    """Attributes of an object by their names, as JSON takes them; days and times as ISO 8601."""
    return {name: _plain(getattr(item, name)) for name in names}


def _plain(value: Any) -> JSON:
    if isinstance(value, date):
        return value.isoformat()
    return list(value) if isinstance(value, tuple) else cast(JSON, value)


def from_json(text: str | bytes) -> Any:
    """Parse JSON; the only place that does.

    A key that stands twice in one object has two values, of which programs take one or the other; so it is
    refused, as are NaN and infinite numbers.

    Raises
    ------
    ValueError
        If `text` is not JSON in UTF-8, or holds such a key or number.
    """
    try:
        return json.loads(text, object_pairs_hook=_unambiguous, parse_constant=_no_number)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _unambiguous(pairs: Sequence[tuple[str, JSON]]) -> dict[str, JSON]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        double = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {quoted(double)} exists twice")
    return found


def _no_number(text: str) -> JSON:
    raise ValueError(f"{text} is not a number")


def read_json(path: Path) -> JSON:
    """Read a JSON file.

    Raises
    ------
    ValueError
        If the file is not JSON as `from_json` reads it, or larger than any of ours.
    """
    if path.exists() and (not path.is_file() or path.stat().st_size > _LARGEST_BYTES):
        raise ValueError(f"{path.name} is not a JSON file of aerocal")
    return cast(JSON, from_json(path.read_text(encoding="utf-8")))


def replace_json(path: Path, value: JSON) -> None:
    """Write `value` to `path` so that a reader sees the old file or the new one, never a part."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.unlink(missing_ok=True)
        # Made again, so that a link of this name is not followed.
        with temporary.open("x", encoding="utf-8") as stream:
            stream.write(json_text(value, indent=2) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
