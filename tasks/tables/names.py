"""Names that occur by the million in a table, taken by index and never copied one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Names:
    """Distinct names.

    Attributes
    ----------
    text : (n + 1,) the names; the last one is null, so that index −1 is not a name.
    rank : (n + 1,) the place of each in the order of a table; null comes last.
    """

    text: pa.Array
    rank: Indices

    @classmethod
    def of(cls, names: Sequence[str]) -> Self:
        """Names (n,) that are all different."""
        text = pa.array([*names, None], type=pa.string())
        order = pc.sort_indices(text).to_numpy().astype(np.int64)  # null at the end
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        return cls(text, rank)

    def take(self, index: Indices) -> pa.Array:
        """The names of indices −1 … n − 1."""
        return self.text.take(pa.array(np.where(index < 0, len(self.text) - 1, index)))
