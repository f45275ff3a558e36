"""Reads a report page back: its tables with full values, its text, and what it refers to."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

#: Elements without an end tag.
VOID = {"meta", "br", "link", "img", "hr", "input"}


@dataclass(frozen=True)
class ReadCell:
    """A number of a table: full value as written, and the text shown."""

    data: str
    shown: str


@dataclass
class ReadTable:
    """A table: numbers by (row key, column name), all texts by row key, and the number of columns."""

    keys: list[str] = field(default_factory=list)
    numbers: dict[tuple[str, str], ReadCell] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    headings: int = 0


class Page(HTMLParser):
    """A parsed page; every start tag must have its end tag."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tables: dict[str, ReadTable] = {}
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self._open: list[str] = []
        self._table: ReadTable | None = None
        self._row = ""
        self._cell: dict[str, str] | None = None
        self._shown = ""
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in given.items()]
        if tag not in VOID:
            self._open.append(tag)
        if tag == "table":
            self._table = self.tables.setdefault(given["id"], ReadTable())
            assert not self._table.headings, f"two tables {given['id']}"
        elif tag == "th" and self._table is not None:
            self._table.headings += 1
        elif tag == "tr" and self._table is not None and "data-key" in given:
            self._row = given["data-key"]
            assert self._row not in self._table.keys, self._row
            self._table.keys.append(self._row)
        elif tag == "td":
            self._cell, self._shown = given, ""

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag
        if tag == "table":
            self._table = None
        elif tag == "td" and self._table is not None and self._cell is not None:
            self._table.texts.setdefault(self._row, []).append(self._shown)
            if "data-value" in self._cell:
                read = ReadCell(self._cell["data-value"], self._shown)
                self._table.numbers[self._row, self._cell["data-column"]] = read
            self._cell = None

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._cell is not None:
            self._shown += data


def ends_of_arrows(page: str) -> list[tuple[float, float]]:
    """Places of arrows in the drawings of a page, as parts of width and height: 0 to 1 is inside."""
    places = []
    for drawing in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        (box,) = re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing)
        for path in re.findall(r'<path[^>]*class="mean[^>]*>', drawing):
            moves = re.findall(r"[ML](-?[\d.]+),(-?[\d.]+)", path)
            places += [(float(x) / float(box[0]), float(y) / float(box[1])) for x, y in moves]
    return places
