"""Safe plain text: names from deliveries, and messages that quote them.

Names are kept verbatim, whatever letters they have. Refused are characters nobody sees: control characters
(a terminal obeys them), marks that turn the direction of the text around them, line separators, and what is
no character at all. Angle brackets, quotes and semicolons are ordinary characters; pages and databases take
them as such.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import islice
from typing import TypeAlias

from tasks.magnitude import trouble_in_number

#: Keys and numbers that lead to a value in nested tables and lists.
Place: TypeAlias = tuple[str | int, ...]

#: Most characters of a name.
LONGEST_NAME = 255
#: Most characters of any other text in settings; a path can have so many.
LONGEST_TEXT = 4_096

# C0 and C1 controls; line and paragraph separator; embeddings, overrides and isolates of the direction
# (Unicode Standard Annex 9); surrogates without partner; two noncharacters that XML forbids.
#: For a set of a regular expression.
UNSEEN = r"\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff"
_UNSEEN = re.compile(f"[{UNSEEN}]")
_SHOWN = 40


def trouble_in(text: str, longest: int = LONGEST_NAME) -> str | None:
    """What is wrong with a name, as a sentence; None: nothing."""
    if len(text) > longest:
        return f"The name {quoted(text)} has {len(text):,} characters, more than {longest}."
    unseen = _UNSEEN.search(text)
    if unseen is None:
        return None
    return f"The name {quoted(text)} contains an invisible character (U+{ord(unseen.group()):04X})."


def is_blank(text: str) -> bool:
    """Whether a name or a reason is blank, without visible characters."""
    return not any(character.isprintable() and not character.isspace() for character in text)


def trouble_in_tables(value: object, place: Place = ()) -> tuple[Place, str] | None:
    """The first impossible key, text or number in nested tables and lists: where, and what is wrong."""
    if isinstance(value, str | int | float):
        trouble = trouble_in(value, LONGEST_TEXT) if isinstance(value, str) else trouble_in_number(value)
        return None if trouble is None else (place, trouble)
    if not isinstance(value, dict | list):
        return None
    for key, below in value.items() if isinstance(value, dict) else enumerate(value):
        trouble = trouble_in(key) if isinstance(key, str) else None
        below_it = (*place, key)
        found = (below_it, trouble) if trouble is not None else trouble_in_tables(below, below_it)
        if found is not None:
            return found
    return None


def quoted(text: str) -> str:
    """A name as a message shows it: in quotes, short, every character visible."""
    short = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
    return f"'{visible(short)}'"


def some_of(names: Collection[object], most: int = 5) -> str:
    """The first names, with … for the others."""
    shown = ", ".join(str(name) for name in islice(names, most))
    return f"{shown}, …" if len(names) > most else shown


def visible(text: str, longest: int = 2_000) -> str:
    """A text with invisible characters shown as their numbers, truncated to a number of characters."""
    cut = text if len(text) <= longest else f"{text[:longest]}…"
    return _UNSEEN.sub(lambda found: f"\\u{ord(found.group()):04x}", cut)
