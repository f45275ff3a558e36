"""Make the pictures of docs/gallery.md: ``python -m docs.generate.gallery [RESULTS]``.

Carries out the commands that stand on the page and keeps the figures it shows. Seeds are fixed: one version
draws the same pictures. RESULTS: a folder in which the commands have been carried out before.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

_DOCS = Path(__file__).resolve().parents[1]
PAGE = _DOCS / "gallery.md"
_COMMAND = re.compile(r"^aerocal (.+)$", re.MULTILINE)
_PICTURE = re.compile(r"!\[[^\]]*\]\(images/gallery/([\w-]+\.svg)\)")


def commands() -> list[str]:
    """What the page says to enter, without the name of the program."""
    return _COMMAND.findall(PAGE.read_text(encoding="utf-8"))


def pictures() -> list[str]:
    """Names of the figures that the page shows."""
    return _PICTURE.findall(PAGE.read_text(encoding="utf-8"))


def main() -> int:
    """Carry out the commands, and keep the figures."""
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        program = Path(sys.executable).with_name("aerocal")
        for command in commands() if len(sys.argv) == 1 else ():
            subprocess.run([program, *command.split()], cwd=place, check=True)
        kept = _DOCS / "images" / "gallery"
        shutil.rmtree(kept, ignore_errors=True)
        kept.mkdir(parents=True)
        for name in pictures():
            shutil.copyfile(place / "block" / "results" / "figures" / name, kept / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
