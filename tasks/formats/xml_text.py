"""XML files: parsed as plain elements, without any other feature of XML."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasks.errors import Location
from tasks.files.delivered_file import file_limits
from tasks.formats.text_table import read_bytes

# Characters that are parsed together.
_PIECE = 100_000


def parsed_xml(path: Path) -> ElementTree.Element:
    """The root element of a file.

    Raises
    ------
    InputError
        If the file is not a well-formed XML, or declares document types or entities.
    """
    return _parsed(path, _plain_text(path, read_bytes(path, "document"), None), None)


def parsed_xml_content(path: Path, content: bytes, entity: str | None = None) -> ElementTree.Element:
    """The root element of the content of a file, or of a part of it that `entity` names.

    Raises
    ------
    InputError
        As `parsed_xml`; if it is larger than a document.
    """
    trouble = file_limits().trouble(path, len(content), "document")
    if trouble is not None:
        raise trouble
    return _parsed(path, _plain_text(path, content, entity), entity)


def elements(path: Path, tag: str) -> Iterator[ElementTree.Element]:
    """The elements of a tag in the order in which they end; the next one empties the one before.

    Raises
    ------
    InputError
        As `parsed_xml`, where the trouble is.
    """
    parser: ElementTree.XMLPullParser[ElementTree.Element] = ElementTree.XMLPullParser(("end",))
    with _well_formed(path, None):
        for piece in _pieces(_plain_text(path, read_bytes(path, "document"), None)):
            parser.feed(piece)
            for *_, element in parser.read_events():
                if isinstance(element, ElementTree.Element) and element.tag == tag:
                    yield element
                    element.clear()
        parser.close()


def _parsed(path: Path, text: str, entity: str | None) -> ElementTree.Element:
    parser = ElementTree.XMLParser()
    with _well_formed(path, entity):
        for piece in _pieces(text):
            parser.feed(piece)
        return parser.close()


def _pieces(text: str) -> Iterator[str]:
    """Of a text, and not of bytes: whatever encoding it declares, these characters are parsed.

    In pieces, as a parser keeps what it is given several times.
    """
    return (text[begin : begin + _PIECE] for begin in range(0, len(text), _PIECE))


@contextmanager
def _well_formed(path: Path, entity: str | None) -> Iterator[None]:
    try:
        yield
    except ElementTree.ParseError as error:
        raise Location(path, error.position[0], entity).error(
            f"This is not well-formed XML ({error.msg}).", "Deliver the file again."
        ) from error


def _plain_text(path: Path, content: bytes, entity: str | None) -> str:
    """The text of the file, without declarations of types: entities could read files or fill the memory.

    No delivered file needs them, so they are refused before any parser sees them, whatever version it is of.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise Location(path, entity=entity).error(
            "The file declares document types or entities (<!DOCTYPE>).", "Deliver it without them."
        )
    return text.strip()
