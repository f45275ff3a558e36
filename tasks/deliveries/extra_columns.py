"""Further columns of input files, which are kept as text and reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pyarrow as pa

from tasks.formats.records import ControlRecords, DistanceRecords, ExposureRecords, ImagePointRecords


def joined(extras: Sequence[Mapping[str, pa.Array]], rows: Sequence[int]) -> dict[str, pa.Array]:
    """One column for each name, file after file; null where a file does not have it."""
    names = dict.fromkeys(name for extra in extras for name in extra)
    return {
        name: pa.concat_arrays(
            [extra.get(name, pa.nulls(count, pa.string())) for extra, count in zip(extras, rows, strict=True)]
        )
        for name in names
    }


def about_extra(
    records: Sequence[ImagePointRecords | ExposureRecords | ControlRecords | DistanceRecords],
) -> Iterator[str]:
    """A sentence for each file with further columns."""
    for record in records:
        if record.extra:
            yield f"{record.file.name}: kept as text, and not used: {', '.join(record.extra)}."
