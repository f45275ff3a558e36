"""Build the documentation site: ``python -m docs.generate.site``, in the environment of ``make docs``.

Each version has its own folder: ``main`` is this checkout; every tag is built once, with its own ``conf.py``.
``versions.js`` lists them, newest first. The sidebar of every page reads it, so that an old version also
leads to newer ones. It is a script, not JSON, because a browser does not load JSON from the file system.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "build" / "site"
CHECKOUT = "main"
START = "docs/index.html"


def tags(checkout: Path) -> list[str]:
    """Tags of released versions, newest first; none outside a checkout."""
    command = ["git", "tag", "--list", "v*", "--sort=-version:refname"]
    listed = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    return listed.stdout.split()


def build(source: Path, version: str, *options: str) -> None:
    """Build the pages of a source tree into the folder of its version."""
    sphinx = [sys.executable, "-m", "sphinx", "-q", "-E", "-a", "-b", "html", "-c", "docs"]
    shown = ["-A", f"site_version={version}"]
    subprocess.run([*sphinx, *shown, *options, ".", str(SITE / version)], cwd=source, check=True)


def build_tag(tag: str) -> None:
    """Build the pages of a tag from a temporary clone; its warnings were errors when it was the checkout."""
    with tempfile.TemporaryDirectory() as place:
        clone = ["git", "-c", "advice.detachedHead=false", "clone", "-q", "--branch", tag, str(ROOT), place]
        subprocess.run(clone, check=True)
        build(Path(place), tag)


def write_versions(site: Path, versions: list[str]) -> None:
    """List the versions for the menu, and lead the site's address to the first of them."""
    (site / "versions.js").write_text(f"const VERSIONS = {json.dumps(versions)};\n", encoding="utf-8")
    start = f"{versions[0]}/{START}"
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>aerocal</title>'
        f'<meta http-equiv="refresh" content="0; url={start}"></head>'
        f'<body><a href="{start}">aerocal</a></body></html>\n'
    )
    (site / "index.html").write_text(page, encoding="utf-8")


def main() -> int:
    """Build this checkout, where every warning is an error, and the tags that have not been built yet."""
    released = tags(ROOT)
    try:
        build(ROOT, CHECKOUT, "-W", "--keep-going")
        for tag in released:
            if not (SITE / tag / START).exists():
                build_tag(tag)
    except subprocess.CalledProcessError as error:
        return error.returncode
    write_versions(SITE, [*released, CHECKOUT])
    return 0


if __name__ == "__main__":
    sys.exit(main())
