"""Whether two runs have the same results: ``python -m benchmarks.same_results FOLDER OTHER``.

For every published table: the same bytes, or by how much its numbers differ at most, in standard deviations
where the table has them (column ``sigma_…`` of the value), else against the largest of the column.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd


def difference(one: pd.DataFrame, other: pd.DataFrame) -> tuple[float, str]:
    """The largest difference of two tables and its column; infinite where anything but a number differs."""
    if list(one.columns) != list(other.columns) or len(one) != len(other):
        return np.inf, "shape"
    largest, where = 0.0, ""
    for name in one.columns:
        a, b = one[name], other[name]
        if not pd.api.types.is_float_dtype(a):
            apart = 0.0 if a.equals(b) else np.inf
        elif not np.array_equal(a.isna(), b.isna()):
            apart = np.inf
        else:
            scale = one[f"sigma_{name}"] if f"sigma_{name}" in one.columns else a.abs().max()
            apart = float(np.nan_to_num(((a - b).abs() / np.maximum(scale, 1e-300)).max()))
        if apart > largest:
            largest, where = apart, str(name)
    return largest, where


def main(folder: Path, other: Path) -> int:
    """Print a line for each table; 1 if a difference exceeds 1e-9."""
    worst = 0.0
    for path in sorted(folder.glob("*.parquet")):
        beside = other / path.name
        if not beside.exists():
            print(f"{path.name}: missing in {other}")
            worst = np.inf
        elif path.read_bytes() == beside.read_bytes():
            print(f"{path.name}: the same bytes")
        else:
            apart, column = difference(pd.read_parquet(path), pd.read_parquet(beside))
            print(f"{path.name}: differs by at most {apart:.2g} {column}")
            worst = max(worst, apart)
    return int(worst > 1e-9)


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:3])))
