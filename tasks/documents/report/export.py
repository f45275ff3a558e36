"""The figures of a report as files of their own: SVG that stands alone, for papers and slides.

The drawings are those of the page to the last character; each gets the rules of the page that concern it,
a size and a white ground.
"""

from __future__ import annotations

import re
from hashlib import sha256
from pathlib import Path

from tasks.errors import Location
from tasks.files.delivered_file import is_there, read_delivered
from tasks.files.installation import remove_abandoned, write_whole, writing_into
from tasks.store.own_file import would_be_lost

_FIGURE, _DRAWING, _DRAWN = '<figure id="figure-', "<svg ", "</svg>"
_NAME = re.compile(r'(?P<name>[\w-]{1,99})">')
_RULE = re.compile(r"^svg (?P<rule>[^{].*)$", re.MULTILINE)
_SIZE = re.compile(r'viewBox="0 0 (?P<width>[\d.]+) (?P<height>[\d.]+)"')
_DIGEST = "<!-- aerocal, SHA-256 of what is above: "
#: Colours that the page keeps in variables.
_VARIABLE = re.compile(r"(?P<name>--[\w-]+): (?P<value>#[0-9a-f]+);")


def export_figures(report: Path, out: Path) -> tuple[Path, ...]:
    """Write every figure of a report as ``NAME.svg`` into a folder; returns the files.

    Raises
    ------
    InputError
        If there is no report, it has no figures with names, or a file would be replaced that is not by
        aerocal or was changed since. Nothing is written then.
    InstallationError
        If the disk is full or the folder cannot be written.
    """
    if not is_there(report):
        raise Location(report).error(
            "There is no report.html in the folder of results.",
            "Give the output folder of a run (by default results/ next to the project file).",
        )
    page = read_delivered(report.resolve(), "table").decode(errors="replace")
    found = _figures(page)
    if not found:
        raise Location(report).error(
            "The report contains no named figures.",
            "Run the project again: the report may have been written by an older version.",
        )
    style = _style_of(page)
    files = {out / f"{name}.svg": _signed(standing_alone(drawing, style)) for name, drawing in found.items()}
    for file in files:
        if file.is_file() and not _is_ours(file.read_bytes()):
            raise would_be_lost(file)
    with writing_into(out):
        out.mkdir(parents=True, exist_ok=True)
        remove_abandoned(out)
        for file, drawing in files.items():
            write_whole(file, drawing)
    return tuple(files)


def _signed(drawing: str) -> str:
    """A drawing with the digest by which it is known as ours and unchanged when it is written again."""
    return f"{drawing}{_DIGEST}{sha256(drawing.encode()).hexdigest()} -->\n"


def _is_ours(content: bytes) -> bool:
    drawing, _, _ = content.decode(errors="replace").rpartition(_DIGEST)
    return _signed(drawing).encode() == content


def figure_of(page: str, name: str) -> str:
    """One figure of a page of ours as an SVG file of its own.

    Raises
    ------
    KeyError
        If the page has no figure of this name.
    """
    return standing_alone(_figures(page)[name], _style_of(page))


def _figures(page: str) -> dict[str, str]:
    """Drawings by name. In our pages, drawings do not nest and a figure has one; other pages have none."""
    found = {}
    for part in page.split(_FIGURE)[1:]:
        name, (_, start, rest) = _NAME.match(part), part.partition(_DRAWING)
        drawing, end, _ = rest.partition(_DRAWN)
        if name is not None and start and end:
            found[name["name"]] = start + drawing + end
    return found


def _style_of(page: str) -> str:
    """The rules of a page for its drawings."""
    return drawing_rules(page.partition("<style>")[2].partition("</style>")[0])


def standing_alone(drawing: str, style: str) -> str:
    """A drawing of the page with its style, its size and a white ground."""
    size = _SIZE.search(drawing)
    if size is None:
        raise ValueError("the drawing has no viewBox")
    width, height = size["width"], size["height"]
    start, _, content = drawing.partition(">")
    ground = f'<rect width="{width}" height="{height}" fill="#fff"/>'
    head = f'{start} width="{width}" height="{height}"><style>{style}</style>{ground}'
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}{content}\n'


def drawing_rules(css: str) -> str:
    """The rules of a style sheet for what is inside drawings, variables replaced by their values."""
    # What is set for paper concerns the size of a drawing on the page only.
    screen = css.partition("@media print")[0]
    # Of several selectors none may keep its "svg ", which would outweigh later rules.
    rules = "\n".join(match["rule"].replace(", svg ", ", ") for match in _RULE.finditer(screen))
    for variable in _VARIABLE.finditer(screen):
        rules = rules.replace(f"var({variable['name']})", variable["value"])
    return rules
