"""Layouts that the headings of a table suggest: separator, decimal mark, quotation mark, names of columns.

What is suggested is written into the project file for a person to see; whether the table can be read so, its
reader says.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from tasks.formats.foreign_headings import alike
from tasks.formats.records import AngleOrder
from tasks.formats.table_layout import MARKS, Separator, TableLayout

# Lines above the headings that are tried as none.
_MOST_SKIPPED = 15
_DECIMAL_COMMA = re.compile(r"\d,\d")
TableKind: TypeAlias = Literal["exposures", "image_points", "control", "events"]
_OMEGA, _HEADING = ("omega", "phi", "kappa"), ("heading", "pitch", "roll")
# The columns that each kind of table needs, the most telling kind first.
_KINDS: tuple[tuple[TableKind, tuple[str, ...]], ...] = (
    ("exposures", ("image", "x", "y", "z", *_OMEGA)),
    ("exposures", ("image", "x", "y", "z", *_HEADING)),
    ("image_points", ("image", "point", "x", "y")),
    ("control", ("point", "x", "y", "z")),
    ("events", ("image", "time")),
)
_OPTIONAL: Mapping[TableKind, tuple[str, ...]] = {
    "exposures": ("camera", "strip", "time", "flight"),
    "events": ("camera", "strip", "flight"),
}
_INSTEAD = ("camera", "strip")


@dataclass(frozen=True)
class ProposedTable:
    """One way to read a table.

    Attributes
    ----------
    kind : what its rows would be.
    layout : for the reader.
    order : of the angles, if it has headings and no ω, φ, κ.
    """

    kind: TableKind
    layout: TableLayout
    order: AngleOrder | None = None


def layout_keys(layout: TableLayout) -> Mapping[str, object]:
    """Keys of the project file that declare a layout where it differs from that of our own tables."""
    usual = TableLayout()
    names = ("separator", "decimal", "quote", "skip_lines", "encoding", "columns")
    return {name: getattr(layout, name) for name in names if getattr(layout, name) != getattr(usual, name)}


def proposed_layouts(beginning: bytes) -> Iterator[ProposedTable]:
    """Ways to read a table that begins like this, the most likely first."""
    encoding: Literal["utf-8", "latin-1"] = "utf-8"
    try:
        text = beginning.decode("utf-8-sig")
    except UnicodeDecodeError:
        encoding, text = "latin-1", beginning.decode("latin-1")
    lines = text.splitlines()
    for skip in range(min(_MOST_SKIPPED, len(lines))):
        for separator in _by_count(lines[skip]):
            for quote in ('"', "'"):
                fields = _fields(lines[skip], separator, quote)
                sample = "\n".join(lines[skip + 1 : skip + 20])
                comma = separator != "comma" and _DECIMAL_COMMA.search(sample) is not None
                layout = TableLayout(
                    separator=separator,
                    decimal="," if comma else ".",
                    quote='"' if quote == '"' else "'",
                    skip_lines=skip,
                    encoding=encoding,
                )
                yield from _kinds(fields, layout)


def _by_count(line: str) -> list[Separator]:
    """Separators that divide a line, the most frequent first; blanks last, as they occur next to others."""
    counts = {name: line.count(mark) for name, mark in MARKS.items()}
    counts["blank"] = max(counts["blank"], counts["tab"])
    found: list[Separator] = [name for name, count in counts.items() if count]
    return sorted(found, key=lambda name: (name == "blank", -counts[name]))


def _fields(line: str, separator: Separator, quote: str) -> list[str]:
    text = re.sub(r"\s+", " ", line.strip()) if separator == "blank" else line
    rows = csv.reader(
        [text.lstrip("#% \t")], delimiter=MARKS[separator], quotechar=quote, skipinitialspace=True
    )
    return [field.strip() for field in next(rows, [])]


def _kinds(fields: list[str], layout: TableLayout) -> Iterator[ProposedTable]:
    for kind, needed in _KINDS:
        optional = _OPTIONAL.get(kind, ())
        own = {field.lower(): field for field in fields}
        # Moments have no coordinates: what has some is another table, even if its reader refuses it.
        if kind == "events" and ({"x", "y"} & own.keys() or alike(("x", "y"), fields)):
            continue
        # Image points have no height: survey lists with a number and a label are not taken for them.
        if kind == "image_points" and ("z" in own or alike(("z",), fields)):
            continue
        missing = [name for name in (*needed, *optional) if name not in own]
        others = [field for field in fields if field.lower() not in (*needed, *optional)]
        found = alike(missing, others)
        if any(name in missing and name not in found for name in needed):
            continue
        elsewhere = tuple(
            name for name in _INSTEAD if kind == "exposures" and name in missing and name not in found
        )
        yield ProposedTable(
            kind,
            replace(layout, columns=found, elsewhere=elsewhere),
            "heading-pitch-roll" if "heading" in needed else "omega-phi-kappa" if "omega" in needed else None,
        )
