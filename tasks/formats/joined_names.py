"""Concatenated columns of names, each name kept once, in little more memory than they already take.

To tell whether a name came before, Arrow keeps up to a hundred bytes for each. Where there are many they are
therefore dealt into shares by their characters, and looked up share by share.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TypeAlias, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tasks.errors import InputError
from tasks.files.in_turn import in_turn

_Item = TypeVar("_Item")
_Codes: TypeAlias = NDArray[np.int32]

# Names that are looked up together.
_SHARE = 500_000
# Parts of a column that are worked on at a time.
_THREADS = 2
# Characters that are taken together, and how many tell the share of a name.
_WORD, _TELLING = 8, 64
# Odd, with bits in no order: every character moves all bits above its own.
_FACTOR = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)
_MOST_BYTES = 2**31 - 1


def joined_names(parts: list[pa.DictionaryArray]) -> pa.DictionaryArray:
    """Columns of names one after the other, each name kept once; the list is empty then.

    Up to half a million names are in the order in which they come first.

    Raises
    ------
    InputError
        If the names together are longer than Arrow's texts can be.
    """
    if len(parts) == 1:
        return parts.pop()
    shares = 1 + sum(len(part.dictionary) for part in parts) // _SHARE
    indices, dealt, number_of = [], [], []
    for own, names_of_shares, share in in_turn(partial(_dealt, shares), _taken_out(parts), _THREADS):
        indices.append(own)
        dealt.append(names_of_shares)
        # Until a name has its number, that of its share is there, below zero.
        number_of.append(-1 - share)
    import pyarrow.compute as pc

    names = _numbered(dealt, number_of)
    joined = np.empty(sum(map(len, indices)), dtype=np.int32)
    missing = np.zeros(len(joined), dtype=bool) if any(own.null_count for own in indices) else None
    ends = np.cumsum([len(own) for own in indices]).tolist()

    def number(part: tuple[int, pa.Array, _Codes]) -> None:
        end, own, numbers = part
        rows = slice(end - len(own), end)
        if missing is not None:
            missing[rows] = own.is_null().to_numpy(zero_copy_only=False)
        # One more, for those that have no name in a part without any.
        joined[rows] = np.append(numbers, np.int32(0))[pc.fill_null(own, 0).to_numpy(zero_copy_only=False)]

    numbered = zip(ends, _taken_out(indices), _taken_out(number_of), strict=True)
    for _ in in_turn(number, numbered, _THREADS):
        pass
    return pa.DictionaryArray.from_arrays(pa.array(joined, mask=missing), names)


def _taken_out(items: list[_Item]) -> Iterator[_Item]:
    """The items of a list, which nothing holds on to afterwards."""
    while items:
        yield items.pop(0)


def _dealt(shares: int, part: pa.DictionaryArray) -> tuple[pa.Array, list[pa.StringArray | None], _Codes]:
    """Indices of a part, its names by shares, and the share of each."""
    share = _share_of(part.dictionary, shares)
    return part.indices, [part.dictionary.filter(pa.array(share == own)) for own in range(shares)], share


def room_of_names(names: pa.StringArray) -> int:
    """Memory that these names take at most while :func:`joined_names` joins them with others, bytes."""
    bounds = _bounds(names)
    # Each with its bound in two places, and its number.
    return 2 * (int(bounds[-1]) - int(bounds[0]) + bounds.nbytes) + bounds.nbytes


def _share_of(names: pa.StringArray, shares: int) -> _Codes:
    """The part (n,) to which each name is assigned."""
    share = np.zeros(len(names), dtype=np.int32)
    if shares == 1:
        return share
    for begin in range(0, len(names), _SHARE):
        some = names.slice(begin, _SHARE)
        bounds = _bounds(some)
        text = np.frombuffer(some.buffers()[2], dtype=np.uint8)[bounds[0] : bounds[-1]]
        share[begin : begin + len(some)] = _mixed(text, bounds - bounds[0]) * np.uint64(shares) >> _HALF
    return share


def _mixed(text: NDArray[np.uint8], bounds: _Codes) -> NDArray[np.uint64]:
    """A number of 32 bits (n,) that the first characters and the length of each name make."""
    text = np.append(text, np.zeros(_WORD, dtype=np.uint8))
    length = np.diff(bounds)
    mixed = length.astype(np.uint64)
    for at in range(0, min(int(length.max()), _TELLING), _WORD):
        longer = np.flatnonzero(length > at)
        word = text[(bounds[longer] + at)[:, None] + np.arange(_WORD)].view("<u8")[:, 0]
        # Characters behind the end belong to the next name.
        behind = np.maximum(_WORD - (length[longer] - at), 0).astype(np.uint64)
        mixed[longer] = (mixed[longer] ^ (word << np.uint64(8) * behind)) * _FACTOR
    return mixed >> _HALF


def _bounds(names: pa.StringArray) -> _Codes:
    return np.frombuffer(names.buffers()[1], dtype=np.int32)[names.offset : names.offset + len(names) + 1]


def _numbered(dealt: list[list[pa.StringArray | None]], number_of: list[_Codes]) -> pa.StringArray:
    """All names once; in `number_of` their numbers, for each part. What was looked up is taken from `dealt`.

    Raises
    ------
    InputError
        As of :func:`joined_names`.
    """
    import pyarrow.compute as pc

    count = sum(map(len, number_of))
    size = sum(int(pc.sum(pc.binary_length(names)).as_py() or 0) for part in dealt for names in part)
    # What is not written into takes no memory.
    text, bounds = np.empty(size, dtype=np.uint8), np.zeros(count + 1, dtype=np.int32)
    known, end = 0, 0

    def looked_up(share: int) -> pa.DictionaryArray:
        found = pa.concat_arrays([part[share] for part in dealt]).dictionary_encode()
        for part in dealt:
            part[share] = None
        return found

    # While the names of a share get their numbers, those of the next one are looked up.
    for share, found in enumerate(in_turn(looked_up, range(len(dealt[0])), threads=1)):
        codes = found.indices.to_numpy()
        taken = 0
        for numbers in number_of:
            own = np.flatnonzero(numbers == -1 - share)
            numbers[own] = known + codes[taken : taken + len(own)]
            taken += len(own)
        added = _bounds(found.dictionary)
        begin, end = end, end + int(added[-1] - added[0])
        if end > _MOST_BYTES:
            raise InputError(
                f"The names of one kind have more than {_MOST_BYTES:,} bytes in total.",
                "Deliver the right file, or shorter names.",
            )
        text[begin:end] = np.frombuffer(found.dictionary.buffers()[2], dtype=np.uint8)[added[0] : added[-1]]
        bounds[known + 1 : known + 1 + len(found.dictionary)] = begin + (added[1:] - added[0])
        known += len(found.dictionary)
        # What was looked up goes back to the machine, not only to those who ask for as much again.
        del found, codes, added
        pa.default_memory_pool().release_unused()
    return pa.StringArray.from_buffers(known, pa.py_buffer(bounds[: known + 1]), pa.py_buffer(text[:end]))
