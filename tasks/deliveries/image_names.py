"""Names of images in a file that had to use others: numbers of PATB, truncated names."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
import pyarrow as pa

from tasks.errors import Location
from tasks.formats.records import ExposureRecords, ImagePointRecords
from tasks.formats.text_lines import DeliveredLines
from tasks.formats.text_rows import Layout
from tasks.formats.text_table import read_rows
from tasks.nearest_name import did_you_mean

_Records = TypeVar("_Records", ExposureRecords, ImagePointRecords)


def with_image_names(records: _Records, table: Path | None) -> _Records:
    """The records with the images' names of a table: a line of headings, then name in the file, name here.

    Raises
    ------
    InputError
        If the table gives a name twice, or lacks one of the file.
    """
    if table is None:
        return records
    text = DeliveredLines.of(table, lone_return=b"\n")
    pieces = text.pieces()
    below = next(pieces).partition(b"\n")[2]
    layout = Layout(table, ("theirs", "ours"), (), "comma")
    rows = read_rows(text, chain([below] if below else [], pieces), layout, 2)
    theirs, ours = rows.text("theirs").to_pylist(), rows.text("ours").to_pylist()
    for names in (theirs, ours):
        again = pd.Series(names).duplicated().to_numpy()
        if again.any():
            row = int(np.argmax(again))
            raise Location(table, int(rows.line[row]), names[row]).error(
                "The name is in two lines.", "Keep one of them."
            )
    known = dict(zip(theirs, ours, strict=True))
    kept_once = isinstance(records.image, pa.DictionaryArray)
    encoded = records.image if kept_once else records.image.dictionary_encode()
    delivered = encoded.dictionary.to_pylist()
    missing = next((name for name in delivered if name not in known), None)
    if missing is not None:
        row = int(np.argmax(np.array(records.image.to_pylist(), dtype=object) == missing))
        raise Location(records.file, int(records.line[row]), missing).error(
            f"The table of names, {table.name}, does not have this image.",
            f"Add it there. {did_you_mean(missing, theirs)}",
        )
    names = pa.array([known[name] for name in delivered], pa.string())
    image = pa.DictionaryArray.from_arrays(encoded.indices, names)
    return replace(records, image=image if kept_once else image.cast(pa.string()))
