"""Columns that grow row by row, in little more memory than they take in the end.

A number in a Python list takes four times its eight bytes, and a name of its own in every row seventy bytes.
"""

from __future__ import annotations

from array import array

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.formats.joined_names import joined_names

# Names that are looked up together.
_MANY = 100_000


class LongNames:
    """A column of names, most of which occur again."""

    def __init__(self) -> None:
        self._waiting: list[str] = []
        self._parts: list[pa.DictionaryArray] = []

    def append(self, name: str) -> None:
        """Add a row."""
        self._waiting.append(name)
        if len(self._waiting) >= _MANY:
            self._encode()

    def extend(self, names: list[str]) -> None:
        """Add rows."""
        self._waiting += names
        if len(self._waiting) >= _MANY:
            self._encode()

    def column(self) -> pa.DictionaryArray:
        """All rows, each name kept once; the column is empty then."""
        self._encode()
        return joined_names(self._parts)

    def _encode(self) -> None:
        self._parts.append(pa.array(self._waiting, pa.string()).dictionary_encode())
        self._waiting = []


def table_of(values: array[float], width: int) -> Floats:
    """Rows (n, width) of the numbers that were put one behind the other."""
    return np.frombuffer(values, dtype=np.float64).reshape(-1, width)
