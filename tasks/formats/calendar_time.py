"""Dates with a time as seconds since 6 January 1980, on any time scale."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

from tasks.errors import Location
from tasks.plain_text import quoted

_EPOCH = date(1980, 1, 6)
_DAY_S = 86_400
_DATE = re.compile(
    r"\s*(\d{4})[/-](\d{1,2})[/-](\d{1,2})(?:\s+|T)(\d{1,2}):(\d{2}):(\d{2}(?:\.\d{1,12})?)Z?\s*", re.ASCII
)


def seconds_of_date(path: Path, text: str, line: int) -> float:
    """Seconds since 6 January 1980 of ``2020/12/24 21:28:42.000`` or ``2020-12-24T21:28:42.000``.

    Raises
    ------
    InputError
        If the text is not a date with a time.
    """
    found = _DATE.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        year, month, day, hour, minute = (int(part) for part in found.groups()[:5])
        days = (date(year, month, day) - _EPOCH).days
        seconds = float(found[6])
        if hour > 23 or minute > 59 or seconds >= 61.0 or days < 0:
            raise ValueError
    except ValueError as error:
        raise Location(path, line).error(
            f"{quoted(text)} is not a date with a time since 1980.",
            "Write it like 2020-12-24T21:28:42.000 or 2020/12/24 21:28:42.000, on the declared clock, "
            "without a time zone.",
        ) from error
    return float(days * _DAY_S + hour * 3600 + minute * 60) + seconds
