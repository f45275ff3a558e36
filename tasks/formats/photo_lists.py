"""Image points in lists that end with −99: PATB ``.im`` (also ``.ima``, ``.f``) and BINGO ``image.dat``.

The first line of a list names the photo, all that follows on it is free; the others are point, x, y and
whatever else. Coordinates are in the image system (origin at the format centre, y up) in the unit that the
project file declares: µm in old PATB projects, else mm.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np

from tasks.errors import InputError
from tasks.formats.plain_lines import text_of
from tasks.formats.plain_records import image_points_of
from tasks.formats.records import ImagePointRecords
from tasks.magnitude import HUGE
from tasks.plain_text import quoted

_END = "-99"
_COMMENT = re.compile(r"#[^\n]*")


def read_photo_lists(path: Path) -> ImagePointRecords:
    """Read image points.

    Raises
    ------
    InputError
        With file and line: a point without two coordinates; a list that does not end.
    """
    import pandas as pd

    # Emptied, and not left to the parser, which would not count their lines.
    text = _COMMENT.sub("", text_of(path))
    width = max(len(line.split()) for line in text.split("\n"))
    if width < 3:
        raise InputError(
            "The file has no line with point, x and y.", "Check that it is a file of image points.", file=path
        )
    names = [str(k) for k in range(width)]
    try:
        table = pd.read_csv(
            io.StringIO(text),
            sep=r"\s+",
            header=None,
            names=names,
            usecols=names[:3],
            dtype=str,
            quoting=csv.QUOTE_NONE,
            skip_blank_lines=False,
            keep_default_na=False,
            na_values=[""],
        )
    except pd.errors.ParserError as error:
        raise InputError(
            "The lines cannot be divided into fields.",
            "Check that this is a file of image points.",
            file=path,
        ) from error
    table = table[table["0"].notna()]
    end = table["0"].to_numpy() == _END
    first = np.concatenate([[True], end[:-1]]) & ~end
    rows = np.flatnonzero(~end & ~first)
    photo = np.maximum.accumulate(np.where(first, np.arange(len(table)), 0))[rows]
    line = table.index.to_numpy(dtype=np.int64)[rows] + 1
    given = table.iloc[rows]
    xy = np.column_stack([pd.to_numeric(given[name], errors="coerce").to_numpy(float) for name in names[1:3]])
    bad = ~(np.abs(xy) <= HUGE).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"The point {quoted(str(given['0'].iloc[row]))} has no two coordinates.",
            "Correct them; if this line is the first of a photo, the list above lacks its end, -99.",
            file=path,
            line=int(line[row]),
        )
    image = table["0"].iloc[photo].tolist()
    return image_points_of(path, image, given["0"].tolist(), xy, line.tolist())
