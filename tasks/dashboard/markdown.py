"""Markdown that says what it is told to: names in it are shown, and never obeyed.

The dashboard renders Markdown with tables. A name from a delivery may hold anything; whatever has a meaning
in Markdown or HTML is written so that it has none.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NewType

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tasks.plain_text import visible

TEMPLATES = Path(__file__).parent / "templates"

# An underscore between letters, as names have them, means nothing.
_SPECIAL = re.compile(r"[\\`*{}\[\]#|~$]|(?<![^\W_])_|_(?![^\W_])|:(?=//)")
# What begins a list, a heading or a rule if it stands first.
_FIRST = re.compile(r"^([-+=]|\d+(?=[.)](?:\s|$)))")
_HTML = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


class Markdown(str):
    """Text that is Markdown already."""


Line = NewType("Line", str)


def in_one_line(text: str) -> Line:
    """A text without line ends, and with nothing in it that nobody sees."""
    return Line(visible(" ".join(text.split())))


def in_a_cell(text: str) -> str:
    """A name for a cell of a table artifact.

    One of the dashboard's two faces shows such a cell as it is, the other as Markdown. An unseen joiner
    behind what opens a tag, a link or an entity changes nothing in the one and keeps the other from obeying.
    """
    return re.sub(r"[<\]&]", "\\g<0>\u2060", in_one_line(text))


def inert(value: object) -> str:
    """A value as Markdown that shows it and does nothing else; what is `Markdown` passes."""
    if isinstance(value, Markdown):
        return value
    line = in_one_line(str(value))
    escaped = _SPECIAL.sub(r"\\\g<0>", line).translate(_HTML)
    # A digit cannot be escaped; the point behind it can.
    return _FIRST.sub(lambda found: f"{found[0]}\\" if found[0].isdigit() else f"\\{found[0]}", escaped)


def code(value: object) -> Markdown:
    """A path as a piece of code; not for the cells of a table."""
    line = in_one_line(str(value))
    longest = max((len(run) for run in re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    space = " " if longest else ""
    return Markdown(f"{fence}{space}{line}{space}{fence}")


def link(words: str, address: str) -> Markdown:
    """A link; the address is one of ours, with its parts percent-encoded."""
    return Markdown(f"[{inert(words)}](<{address}>)")


def render(template: str, **values: object) -> str:
    """Fill a template; every value passes `inert`."""
    text: str = _environment().get_template(template).render(**values)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        finalize=inert,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"code": code, "markdown": Markdown}
    return environment
