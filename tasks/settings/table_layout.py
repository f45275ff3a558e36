"""Settings of the layout of a table of text (`format = "csv"`), for tables that others have written."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from tasks.formats.table_layout import Separator, TableLayout
from tasks.plain_text import is_blank
from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Positive, Whole

_MOST_LINES, _MOST_COLUMNS = 10_000, 1_000


def _visible(text: str) -> str:
    if is_blank(text):
        raise trouble("The name is empty.", "Give one, or leave the key out.")
    return text


Name: TypeAlias = Annotated[str, Field(min_length=1), AfterValidator(_visible)]
ColumnNumber: TypeAlias = Annotated[Whole, Field(ge=1, le=_MOST_COLUMNS)]


class TableSettings(Settings):
    """Layout of a table with `format = "csv"`; the defaults are those of aerocal's own tables.

    The keys are part of `[inputs.image_points]`, `[inputs.exposures]` and `[inputs.control]` themselves.
    """

    separator: Separator = "comma"
    """Separator between columns; `blank` is any sequence of blanks or tabs."""
    decimal: Literal[".", ","] = "."
    """Decimal mark of numbers."""
    columns: dict[str, Name | ColumnNumber] = Field(default_factory=dict)
    """aerocal's name of a column → its heading in the file, or its number from 1: `columns = { point =
    "Name", x = "Easting" }`. Columns with aerocal's headings need not be listed. The columns that are read
    are listed at `format`.
    """
    unused: tuple[Name, ...] = ()
    """Columns of the file that are ignored although they have aerocal's headings."""
    header: bool = True
    """Whether the rows are preceded by a header line; if not, `columns` are numbers."""
    skip_lines: Annotated[Whole, Field(ge=0, le=_MOST_LINES)] = 0
    """Number of lines at the top of the file that are neither header nor rows."""
    comment: Name | None = None
    """Start of lines that are ignored, e.g. `"#"` or `"//"`."""
    quote: Literal['"', "'"] = '"'
    """Quotation mark around names that contain a separator."""
    encoding: Literal["utf-8", "latin-1"] = "utf-8"
    """Encoding of the text."""

    @model_validator(mode="after")
    def _only_of_tables(self) -> TableSettings:
        given = [name for name in TableSettings.model_fields if name in self.model_fields_set]
        if given and getattr(self, "format", None) != "csv":
            raise trouble(
                f"{', '.join(given)} describe the layout of a table, but the format of this file has its "
                "own.",
                'Leave them out, or declare format = "csv".',
            )
        if self.separator == "comma" and self.decimal == ",":
            raise trouble(
                "A comma cannot be both separator and decimal mark.",
                'Declare the separator, e.g. separator = "semicolon".',
            )
        if not self.header and (not self.columns or any(isinstance(v, str) for v in self.columns.values())):
            raise trouble(
                "Without headings the columns are known by their numbers only.",
                "Declare each, from 1: columns = { point = 1, x = 2, y = 3, z = 4 }.",
            )
        return self

    @property
    def layout(self) -> TableLayout:
        """The layout as readers take it."""
        names = TableSettings.model_fields
        return TableLayout(
            **{name: getattr(self, name) for name in names}, elsewhere=self._given_in_another_way()
        )

    def _given_in_another_way(self) -> tuple[str, ...]:
        return ()


class StripRule(Settings):
    """How strips are separated; `strip = "time-gaps"` is short for `{ gap_factor = 3.0 }`."""

    gap_factor: Positive | None = None
    """A strip ends where the next image follows after more than this many median intervals of the file. In
    each flight, strips are numbered in order of time.
    """
    pattern: Name | None = None
    """Position of strip (and flight) in the image name: `{strip}`, `{flight}`, `*` for any text, `?` for one
    character, all other characters literally. `{strip}` and `*` end at the first occurrence of the character
    that follows them: `"*_{strip}_*"` finds 05 in `2015_05_0182`.
    """

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object) -> object:
        if isinstance(value, str):
            if value == "time-gaps":
                return {"gap_factor": 3.0}
            raise trouble(
                "The definition of strips is not valid.",
                'Write "time-gaps", or { pattern = "{strip}_*" }.',
            )
        return value

    @model_validator(mode="after")
    def _one_of_both(self) -> StripRule:
        if (self.gap_factor is None) == (self.pattern is None):
            raise trouble("Strips are found by one rule.", "Give gap_factor or pattern.")
        if self.gap_factor is not None and self.gap_factor <= 1.0:
            raise trouble("With gap_factor up to 1 each image is a strip.", "Give more, e.g. 3.")
        pattern = self.pattern or "{strip}"
        if pattern.count("{strip}") != 1 or pattern.count("{flight}") > 1:
            raise trouble("The pattern needs {strip} once.", 'Write for example "*_{strip}_*".')
        plain = pattern.replace("{strip}", "*").replace("{flight}", "*")
        if "**" in plain or "{" in plain or "*?" in plain:
            raise trouble(
                "The pattern does not define where a part of it ends.",
                "Put the character between the two parts, as in the names.",
            )
        return self
