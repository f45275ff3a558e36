"""Control points as a surveyor's note book has them: ``NAME; EAST; NORTH; HEIGHT``, comments after #."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from tasks.errors import InputError
from tasks.formats.records import ControlRecords


def read_lake_text(path: Path) -> ControlRecords:
    """Read control points; CRS, unit and σ are declared in the project file."""
    names, places, lines = [], [], []
    for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        row = text.partition("#")[0].strip()
        if not row:
            continue
        try:
            name, *values = (item.strip() for item in row.split(";"))
            x, y, z = map(float, values)
        except ValueError:
            raise InputError(
                "This is not NAME; EAST; NORTH; HEIGHT.", "Correct the line.", path, line
            ) from None
        names.append(name)
        places.append((x, y, z))
        lines.append(line)
    return ControlRecords(
        file=path,
        point=pa.array(names, pa.string()),
        position=np.array(places, dtype=np.float64).reshape(-1, 3),
        sigma=np.full((len(names), 3), np.nan),
        role=pa.nulls(len(names), pa.string()),
        line=np.array(lines, dtype=np.int64),
    )
