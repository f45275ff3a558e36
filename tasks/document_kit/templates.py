"""The templates of a page: everything is escaped, and undefined names are errors."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined


def rendered(template: str, *folders: Path, **content: object) -> str:
    """A page made from a template of these folders, which it may include others from."""
    return _templates(*folders).get_template(template).render(content)


@cache
def _templates(*folders: Path) -> Environment:
    """Templates of some folders; the first folder that has a name decides."""
    return Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
