"""The known name most similar to a misspelt one, for error messages."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable

_SHOWN = 12


def plain(text: str) -> str:
    """A name in one encoding: accents and their letters in one character, every blank the same."""
    return unicodedata.normalize("NFKC", text)


def look_alike(name: str, other: str) -> str:
    """A sentence, after a blank, about different names that look the same; empty for all others."""
    if plain(name) != plain(other):
        return ""
    return (
        f" They look alike but have different characters, {name!a} and {other!a}: write them with "
        "the same (of accents, the Unicode form NFC)."
    )


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most similar to `name`; None if none is similar."""
    by_lower_case = {plain(candidate).lower(): candidate for candidate in reversed(list(known))}
    found = difflib.get_close_matches(plain(name).lower(), by_lower_case, n=1, cutoff=0.6)
    return by_lower_case[found[0]] if found else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A remedy that names the most similar known name, or some of them if none is similar."""
    names = list(known)
    if not names:
        return "There are none."
    like = nearest(name, names)
    if like is not None:
        return f"Did you mean '{like}'?{look_alike(name, like)}"
    shown = ", ".join(f"'{candidate}'" for candidate in names[:_SHOWN])
    return f"Known names: {shown}{', …' if len(names) > _SHOWN else ''}."
