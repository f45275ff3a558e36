"""Points as ISO well-known binary, the geometry encoding of GeoParquet."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

_POINT_Z = 1001
_RECORD = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8"), ("z", "<f8")])


def points_z(x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]) -> pa.Array:
    """Binary array (n,) of Point Z; null where x or y is NaN, z = NaN where only the height is unknown."""
    records = np.empty(len(x), dtype=_RECORD)
    records["order"] = 1
    records["type"] = _POINT_Z
    records["x"], records["y"], records["z"] = x, y, z
    offsets = np.arange(len(x) + 1, dtype=np.int64) * _RECORD.itemsize
    geometry = pa.LargeBinaryArray.from_buffers(
        pa.large_binary(), len(x), [None, pa.py_buffer(offsets), pa.py_buffer(records.tobytes())]
    )
    known = np.isfinite(x) & np.isfinite(y)
    if not known.all():
        geometry = pc.if_else(pa.array(known), geometry, pa.scalar(None, pa.large_binary()))
    return geometry.cast(pa.binary()) if len(x) * _RECORD.itemsize < 2**31 else geometry
