"""The documentation site: `make docs`. Every warning is an error there: broken links, anchors, docstrings."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

from sphinx.application import Sphinx

_ROOT = Path(__file__).resolve().parents[1]
_PROJECT = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _commit() -> str:
    """Commit and day of the pages, as git has them; empty outside a checkout."""
    command = ["git", "log", "-1", "--format=%h, %cs"]
    try:
        return subprocess.run(command, cwd=_ROOT, check=True, capture_output=True, text=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


project = _PROJECT["name"]
version = release = _PROJECT["version"]
language = "en"
html_title = f"aerocal {version}"

extensions = ["myst_parser", "autoapi.extension", "sphinx.ext.napoleon"]
# The pages stay where they are in the repository, so that every link means the same there and here.
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**.md", "docs/api/**", "examples/*/README.md", "benchmarks/README.md"]
exclude_patterns = [".venv*", "build", "results"]

# Headings can be linked as on other sites that show these pages.
myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]
# Names in docstrings that several classes have are text; pages of one level begin where they like.
suppress_warnings = ["ref.python", "myst.header", "autoapi.python_import_resolution", "toc.not_included"]

# The mathematics, read from its sources: nothing is imported, so nothing of it need be installed.
autoapi_dirs = [str(_ROOT / "adjust")]
autoapi_root = "docs/api"
autoapi_ignore = ["*_kernel.py"]
autoapi_options = ["members", "show-inheritance", "show-module-summary", "imported-members"]
autoapi_add_toctree_entry = False
autoapi_member_order = "bysource"
autoapi_keep_files = False
napoleon_google_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_static_path = []
# Which version and commit a site describes is on every page, below the title.
templates_path = ["templates"]
html_context = {"commit": _commit()}
# Furo's own order, with the menu of versions below the title.
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/versions.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/scroll-end.html",
    ]
}
html_show_sourcelink = False
html_show_sphinx = False
html_show_copyright = False
# The theme takes the fonts of the system; nothing is loaded from anywhere else.
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
highlight_language = "none"

_LITERAL = re.compile(r"(``[^`]*``|:\w+:`[^`]*`)")


def _as_text(_app: Sphinx, _what: str, _name: str, _object: object, _of: object, lines: list[str]) -> None:
    """Formulas in docstrings are text: bars, asterisks and underscores in them are no markup."""
    for number, line in enumerate(lines):
        parts = _LITERAL.split(line)
        parts[::2] = [re.sub(r"(?<!\\)([|`]|(?!^\s*\* )\*|_(?!\w))", r"\\\1", part) for part in parts[::2]]
        lines[number] = "".join(parts)


def setup(app: Sphinx) -> None:
    """Read docstrings as they are meant."""
    app.connect("autodoc-process-docstring", _as_text, priority=900)
