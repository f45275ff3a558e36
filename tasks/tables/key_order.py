"""The order of a table's rows: by its key, text by code points, null last, no key twice."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tasks.tables.schemas import TableSchema


def order_of(table: pa.Table, schema: TableSchema) -> NDArray[np.int64]:
    """Row numbers in the order of the key.

    Raises
    ------
    ValueError
        If two rows have the same key.
    """
    ranks = [_rank(table[name].combine_chunks()) for name in schema.key]
    order = np.lexsort(ranks[::-1]).astype(np.int64)
    same = np.ones(max(len(order) - 1, 0), dtype=bool)
    for rank in ranks:
        same &= rank[order[1:]] == rank[order[:-1]]
    if same.any():
        row = int(order[int(np.argmax(same))])
        key = ", ".join(str(table[name][row].as_py()) for name in schema.key)
        raise ValueError(f"{schema.name}: two rows have the key ({key})")
    return order


def _rank(array: pa.Array) -> NDArray[np.int64]:
    """Rank (n,) of each text among the distinct ones; null comes last."""
    encoded = array.dictionary_encode()
    rank_of = np.empty(len(encoded.dictionary) + 1, dtype=np.int64)
    by_name = pc.sort_indices(encoded.dictionary).to_numpy(zero_copy_only=False).astype(np.int64)
    rank_of[by_name] = np.arange(len(by_name))
    rank_of[-1] = len(by_name)
    indices = encoded.indices.fill_null(len(by_name))
    return np.asarray(rank_of[indices.to_numpy(zero_copy_only=False).astype(np.int64)])


def ascending(tables: Iterable[pa.Table], schema: TableSchema) -> Iterator[pa.Table]:
    """The same tables, once every key is seen to be above the one before it, also across their borders.

    Raises
    ------
    ValueError
        If it is not.
    """
    key, last = list(schema.key), None
    for table in tables:
        keys = table.select(key) if last is None else pa.concat_tables([last, table.select(key)])
        columns = [keys[name].combine_chunks() for name in key]
        above = np.zeros(max(len(keys) - 1, 0), dtype=bool)
        for column in reversed(columns):
            greater, same = _compared(column)
            above = greater | (same & above)
        if not above.all():
            row = int(np.argmin(above)) + 1
            names = ", ".join(str(column[row].as_py()) for column in columns)
            raise ValueError(f"{schema.name}: the row ({names}) is not in the order of the key")
        last = keys.slice(len(keys) - 1) if len(keys) else None
        yield table


def _compared(column: pa.Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each value after the first is greater than the one before, and whether the same; null last."""
    before, after = column[:-1], column[1:]
    null_before, null_after = (part.is_null().to_numpy(zero_copy_only=False) for part in (before, after))
    greater, same = (
        pc.fill_null(test(after, before), False).to_numpy(zero_copy_only=False)
        for test in (pc.greater, pc.equal)
    )
    return greater | (null_after & ~null_before), same | (null_after & null_before)
