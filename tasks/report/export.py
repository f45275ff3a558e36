"""The figures of a report as files of their own: SVG that stands alone, for papers and slides.

The drawings are those of the page to the last character; each gets the rules of the page that concern it,
a size and a white ground.
"""

from __future__ import annotations

import re
from pathlib import Path

from tasks.errors import InputError

# The page is ours: drawings do not nest, and a figure has one.
_FIGURE = re.compile(r'<figure id="figure-(?P<name>[\w-]+)">.*?(?P<svg><svg .*?</svg>)', re.DOTALL)
_RULE = re.compile(r"^svg (?P<rule>[^{].*)$", re.MULTILINE)
_SIZE = re.compile(r'viewBox="0 0 (?P<width>[\d.]+) (?P<height>[\d.]+)"')
#: Colours that the page keeps in variables.
_VARIABLE = re.compile(r"(?P<name>--[\w-]+): (?P<value>#[0-9a-f]+);")


def export_figures(report: Path, out: Path) -> tuple[Path, ...]:
    """Write every figure of a report as ``NAME.svg`` into a folder; returns the files.

    Raises
    ------
    InputError
        If there is no report, or it has no figures with names.
    """
    if not report.is_file():
        raise InputError(
            "There is no report.html in the folder of results.",
            "Give the folder a run has written into (results/ beside the project file by default).",
            file=report,
        )
    page = report.read_text(encoding="utf-8")
    found = _figures(page)
    if not found:
        raise InputError(
            "The report has no figures with names.",
            "Run the project again: the report may come from an older version.",
            file=report,
        )
    style = _style_of(page)
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for name, drawing in found.items():
        file = out / f"{name}.svg"
        file.write_text(standing_alone(drawing, style), encoding="utf-8")
        files.append(file)
    return tuple(files)


def figure_of(page: str, name: str) -> str:
    """One figure of a page of ours as an SVG file of its own.

    Raises
    ------
    KeyError
        If the page has no figure of this name.
    """
    return standing_alone(_figures(page)[name], _style_of(page))


def _figures(page: str) -> dict[str, str]:
    return {match["name"]: match["svg"] for match in _FIGURE.finditer(page)}


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
    rules = "\n".join(match["rule"] for match in _RULE.finditer(screen))
    for variable in _VARIABLE.finditer(screen):
        rules = rules.replace(f"var({variable['name']})", variable["value"])
    return rules
