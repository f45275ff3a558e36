"""The order of a table's rows: by its key, text by code points, null last, no key twice."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from adjust.arrays import order_of_numbers
from tasks.tables.schemas.columns import TableSchema


def order_of(table: pa.Table, schema: TableSchema) -> NDArray[np.int64]:
    """Row numbers in the order of the key.

    Raises
    ------
    ValueError
        If two rows have the same key.
    """
    ranks = [_rank(table[name].combine_chunks()) for name in schema.key]
    order = order_of_numbers(*ranks[::-1])
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
    """The same tables, after checking that every key exceeds the one before it, also across their borders.

    Raises
    ------
    ValueError
        If it is not.
    """
    key, last = list(schema.key), None
    for table in tables:
        keys = table.select(key) if last is None else pa.concat_tables([last, table.select(key)])
        columns = [keys[name].combine_chunks() for name in key]
        wrong = _out_of_order(columns)
        if len(wrong):
            names = ", ".join(str(column[int(wrong[0])].as_py()) for column in columns)
            raise ValueError(f"{schema.name}: the row ({names}) is not in the order of the key")
        last = keys.slice(len(keys) - 1) if len(keys) else None
        yield table


def _out_of_order(columns: list[pa.Array]) -> NDArray[np.int64]:
    """Rows whose key, made of these columns, does not exceed that of the row before; ascending.

    A column is looked at where all columns before it leave the order open: most texts are never compared.
    """
    open_rows = np.arange(1, len(columns[0]))
    wrong: list[NDArray[np.int64]] = []
    for column in columns:
        same = _tested(pc.equal, column, open_rows, of_nulls=True)
        others = open_rows[~same]
        wrong.append(others[~_tested(pc.greater, column, others, of_nulls=False)])
        open_rows = open_rows[same]
    return np.sort(np.concatenate([*wrong, open_rows]))


def _tested(
    test: Callable[[pa.Array, pa.Array], pa.Array],
    column: pa.Array,
    rows: NDArray[np.int64],
    of_nulls: bool,
) -> NDArray[np.bool_]:
    """Whether some rows of a column are in a relation to the row before; null is greater than all else."""
    if len(rows) == 0:
        return np.zeros(0, dtype=bool)
    # All of them: to take some texts out takes longer than to compare them.
    before, after = column[:-1], column[1:]
    found = pc.fill_null(test(after, before), False).to_numpy(zero_copy_only=False)
    if column.null_count:
        null_before, null_after = (part.is_null().to_numpy(zero_copy_only=False) for part in (before, after))
        found = found | (null_after & (null_before if of_nulls else ~null_before))
    return np.asarray(found[rows - 1])
