"""Names that are requested and do not exist: what does exist is said in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Ints, as_indices
from adjust.errors import InconsistentBlockError, UnknownNameError

_Value = TypeVar("_Value")
# So many names are listed; of more, the first ones and their number.
_LISTED = 12


class NamedValues(dict[str, _Value]):
    """A dictionary whose error says which names there are.

    Attributes
    ----------
    what : what the names are names of, in the singular.
    remedy : what to do about a missing one, a sentence; may be empty.
    """

    what: str = "family of system parameters"
    remedy: str = (
        "The result contains a family only if the block does; give it to the block as SystemParameters, "
        "held or free."
    )

    def __missing__(self, name: str) -> _Value:
        raise unknown_name(self.what, name, self, self.remedy)


def unknown_name(what: str, name: object, known: Collection[str], remedy: str = "") -> UnknownNameError:
    """The error for a name that does not exist: the most similar names, else which there are.

    Parameters
    ----------
    what : what it should have been, in the singular.
    known : the names that exist.
    remedy : a further sentence.
    """
    names = tuple(known)
    near = tuple(get_close_matches(str(name), names, n=3)) if isinstance(name, str) else ()
    if near:
        says = f"Did you mean {_or(near)}?"
    elif not names:
        says = "There are none."
    else:
        more = f" … ({len(names):,} in all)" if len(names) > _LISTED else ""
        says = f"There are: {', '.join(names[:_LISTED])}{more}."
    return UnknownNameError(" ".join(filter(None, (f"There is no {what} {name!r}.", says, remedy))), names)


def places_of(what: str, wanted: Collection[str], known: Mapping[str, int]) -> list[int]:
    """Indices of names, in the order in which they are requested.

    Raises
    ------
    UnknownNameError : for the first name that does not exist, or is requested twice.
    """
    found: dict[int, None] = {}
    for name in wanted:
        if name not in known:
            raise unknown_name(what, name, known)
        if known[name] in found:
            raise UnknownNameError(f"The {what} {name!r} is named twice.", tuple(known))
        found[known[name]] = None
    return list(found)


def numbers_of(what: str, names: Sequence[str]) -> dict[str, int]:
    """The place of every name.

    Raises
    ------
    InconsistentBlockError : two have one name.
    """
    known = {name: number for number, name in enumerate(names)}
    if len(known) < len(names):
        twice = next(name for number, name in enumerate(names) if known[name] != number)
        raise InconsistentBlockError(
            f"Two of the {what}s have the name {twice!r}, so the name does not say which one is meant."
        )
    return known


def indices_of(what: str, wanted: ArrayLike, names: Sequence[str]) -> Ints:
    """Indices (k,) of names, which may come again, in their order; integers are indices already.

    Raises
    ------
    InconsistentBlockError : two have one name.
    UnknownNameError : for the first name that does not exist.
    """
    asked = np.asarray(wanted)
    if asked.dtype.kind not in "UO":
        return as_indices(f"The indices of the {what}s", asked, asked.size)
    different, place = np.unique(asked, return_inverse=True)
    known = numbers_of(what, names)
    unknown = next((name for name in different.tolist() if name not in known), None)
    if unknown is not None:
        raise unknown_name(what, unknown, names)
    return np.array([known[name] for name in different.tolist()], dtype=np.int64)[place]


def _or(names: tuple[str, ...]) -> str:
    quoted = [repr(name) for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} or {quoted[-1]}"
