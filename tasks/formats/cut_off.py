"""Whether a table ends inside a number: nothing else in a file shows that it was truncated there."""

from __future__ import annotations

from tasks.errors import InputError
from tasks.formats.table_layout import MARKS
from tasks.formats.text_rows import Layout
from tasks.plain_text import quoted

# What is looked at of the end of a file, bytes, and the lines that say how long its numbers are.
_TAIL, _FEWEST_BEFORE = 20_000, 50


def refuse_short_last_number(before: bytes, content: bytes, layout: Layout, first_line: int) -> None:
    """Refuse a file that ends inside its last number.

    Its last line has no end, and at least two decimals fewer than each of the lines before it.

    Parameters
    ----------
    before : the rows before, as far as they are known.
    content, first_line : as of `rows_of`.
    """
    if content.endswith(b"\n") or layout.names[-1] not in layout.numeric:
        return
    # The first one may have been cut here.
    lines = (before[-_TAIL:] + content[-_TAIL:]).splitlines()[1:]
    if len(lines) < _FEWEST_BEFORE:
        return
    *others, last = lines
    fewest = min(_decimals(line, layout) for line in others)
    if _decimals(last, layout) <= fewest - 2:
        text = last.rsplit(MARKS[layout.separator].encode(), 1)[-1].decode(layout.encoding, "replace")
        raise InputError(
            f"The file ends with {quoted(text)} and no line end; the lines before have {fewest} decimals or "
            "more.",
            "The file may have been cut off here: deliver it again, or end its last line.",
            file=layout.file,
            line=first_line + content.count(b"\n"),
        )


def _decimals(line: bytes, layout: Layout) -> int:
    """Digits behind the decimal mark of the last field."""
    field = line.rsplit(MARKS[layout.separator].encode(), 1)[-1]
    return len(field.strip().partition(layout.decimal.encode())[2])
