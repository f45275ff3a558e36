"""What is wrong with a row that the parser of tables refused: the line, what stands there, what to do."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tasks.errors import InputError
from tasks.formats.table_layout import Separator
from tasks.plain_text import quoted

_DECIMAL_COMMA = re.compile(r"^[+-]?\d+,\d+$")
#: Remedy of a row with more columns than the table has.
TOO_MANY = "Correct it; numbers need a decimal point if no comma is declared, and {} only separates columns."


def malformed(message: str, file: Path, expected: int, first_line: int, separator: Separator) -> InputError:
    """What the parser complained of, with the line of the file."""
    quote = re.search(r"EOF inside string starting at row (\d+)", message)
    if quote:
        line = int(quote.group(1)) + first_line
        return InputError("A quotation mark is not closed.", "Close it or delete it.", file=file, line=line)
    found = re.search(r"in line (\d+)", message)
    return InputError(
        f"This line has more than {expected} columns.",
        TOO_MANY.format(f"a {separator}"),
        file=file,
        line=int(found.group(1)) - 1 + first_line if found else None,
    )


def not_text(content: bytes, file: Path, first_line: int, encoding: str) -> InputError:
    """The first line that is no text in this encoding."""
    try:
        content.decode(encoding)
        line = None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + first_line
    return InputError(
        f"There are characters here that are not {encoding.upper()} text.",
        "Save the file as UTF-8.",
        file=file,
        line=line,
    )


def not_a_number(
    content: bytes,
    file: Path,
    numeric: Sequence[str],
    options: Mapping[str, Any],
    first_line: int,
) -> InputError:
    """Read everything as text and name the first field that is not a number."""
    with warnings.catch_warnings():
        # Of fields beyond the columns, which are refused where all numbers are some.
        warnings.simplefilter("ignore", pd.errors.ParserWarning)
        try:
            frame = pd.read_csv(io.BytesIO(content), dtype=object, **options)
        except UnicodeDecodeError:
            return not_text(content, file, first_line, options["encoding"])
    bad = np.zeros((len(frame), len(numeric)), dtype=bool)
    for position, name in enumerate(numeric):
        given = frame[name].notna()
        # "nan" converts, but is not a number either.
        shown = frame[name]
        if options["decimal"] == ",":
            shown = shown.str.replace(".", "?").str.replace(",", ".")
        bad[:, position] = (given & pd.to_numeric(shown, errors="coerce").isna()).to_numpy()
    row = int(np.argmax(bad.any(axis=1)))
    name = list(numeric)[int(np.argmax(bad[row]))]
    value = str(frame[name].iloc[row])
    remedy = "Correct the field or delete the line."
    if _DECIMAL_COMMA.match(value):
        remedy = 'Declare decimal = "," for this input, or write numbers with a decimal point.'
    elif value.lower().lstrip("+-") in {"nan", "na", "null", "none"}:
        remedy = "Leave the field empty if the value is not known and may be missing, else delete the line."
    what = f"{quoted(value)} in the column '{name}' is not a number."
    return InputError(what, remedy, file=file, line=row + first_line)
