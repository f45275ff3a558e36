"""Layout of a text table as its project file declares it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Separator: TypeAlias = Literal["comma", "semicolon", "tab", "bar", "blank"]
#: What stands between two columns; ``blank`` is any run of blanks and tabs.
MARKS: Mapping[Separator, str] = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "blank": " "}


@dataclass(frozen=True)
class TableLayout:
    """Layout of a table; without a declaration, that of our own files.

    Attributes
    ----------
    separator : between columns.
    decimal : mark of numbers.
    columns : our name of a column → its heading in the file, or its number from 1.
    elsewhere : our names of columns that the project file gives in another way, and none need have.
    unused : headings that are not to be read, however much they are like ours.
    header : whether a line of headings is above the rows.
    skip_lines : lines above the headings (or the rows) that are none.
    comment : beginning of lines that are not rows.
    quote : mark around texts with separators.
    encoding : of the text.
    """

    separator: Separator = "comma"
    decimal: Literal[".", ","] = "."
    columns: Mapping[str, str | int] = field(default_factory=dict)
    elsewhere: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    header: bool = True
    skip_lines: int = 0
    comment: str | None = None
    quote: Literal['"', "'"] = '"'
    encoding: Literal["utf-8", "latin-1"] = "utf-8"
