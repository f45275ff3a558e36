"""Names that a format accepts, and the table of those that had to be changed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from urllib.parse import quote

from tasks.errors import InputError
from tasks.handover.formats.numbers import table

# Of a file of an image; numbers behind a point belong to the name.
_ENDING = re.compile(r"(?<=.)\.[A-Za-z]\w{0,3}$")


def stem(name: str) -> str:
    """The name of an image without folder and without the ending of its file."""
    return _ENDING.sub("", re.split(r"[\\/]", name)[-1])


def stems(names: Sequence[str]) -> list[str]:
    """The same of all images, for formats with a file for each.

    Raises
    ------
    InputError
        If two images would have the same file.
    """
    image_of: dict[str, str] = {}
    for name in names:
        other = image_of.setdefault(stem(name), name)
        if other != name:
            raise InputError(
                f"Every image has a file of its own, which would be the same for '{other}' and '{name}'.",
                "Write a format with one file for all images.",
                entity=f"image {name}",
            )
    return list(image_of)


def uri_of(name: str) -> str:
    """The URI reference of an image, with %20 for a blank; signs of paths stay as they are."""
    return quote(name, safe="/\\:")


def without_blanks(names: Sequence[str], others: str = "") -> list[str]:
    """Names with '_' for every blank, and for these other signs; a name already in use gets a number."""
    kept = {name for name in names if not any(sign.isspace() or sign in others for sign in name)}
    found = []
    for name in names:
        short = "".join("_" if sign.isspace() or sign in others else sign for sign in name)
        if name not in kept:
            wanted, number = short, 2
            while short in kept:
                short, number = f"{wanted}_{number}", number + 1
            kept.add(short)
        found.append(short)
    return found


def renamed(file: str, what: str, short: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """The table of names; none where they are the same."""
    if list(short) == list(names):
        return {}
    return {file: table([f"{what}_there", what], list(zip(short, names, strict=True)))}


def tie_names(names: Sequence[str]) -> dict[str, str]:
    """The table of tie points in the order of a format that does not name them; None without points."""
    if not names:
        return {}
    rows = [[f"tie{number}", name] for number, name in enumerate(names, start=1)]
    return {"tie_points.csv": table(["point_there", "point"], rows)}
