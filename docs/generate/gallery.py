"""Make the pictures and the output in docs/gallery.md: ``python -m docs.generate.gallery``.

Carries out the commands on the page, writes what the adjustment prints below them, and keeps the figures that
the page shows. Seeds are fixed: one version draws the same figures, and a test holds the page to them.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

_DOCS = Path(__file__).resolve().parents[1]
PAGE = _DOCS / "gallery.md"
KEPT = _DOCS / "images" / "gallery"
_COMMAND = re.compile(r"^aerocal (.+)$", re.MULTILINE)
_PICTURE = re.compile(r"!\[[^\]]*\]\(images/gallery/([\w-]+\.svg)\)")
_PRINTED = re.compile(r"(prints:\n\n```\n)(.*?)(^```$)", re.DOTALL | re.MULTILINE)


def commands() -> list[str]:
    """What the page says to enter, without the name of the program."""
    return _COMMAND.findall(PAGE.read_text(encoding="utf-8"))


def pictures() -> list[str]:
    """Names of the figures that the page shows."""
    return _PICTURE.findall(PAGE.read_text(encoding="utf-8"))


def printed(page: str) -> str:
    """What the page says that the adjustment prints."""
    (match,) = _PRINTED.finditer(page)
    return match[2]


def _program(arguments: list[str], place: Path) -> str:
    """What the program prints to standard output when it is started in a folder."""
    done = subprocess.run(
        [Path(sys.executable).with_name("aerocal"), *arguments],
        cwd=place,
        env={**os.environ, "COLUMNS": "80"},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    return done.stdout


def carry_out(place: Path, aerocal: Callable[[list[str], Path], str] = _program) -> tuple[str, Path]:
    """Carry out the commands in a folder: what ``aerocal run`` prints, and the folder of the figures."""
    shown = ""
    for command in commands():
        printed_by_it = aerocal(command.split(), place)
        if command.startswith("run "):
            shown = "\n".join(line.rstrip() for line in printed_by_it.strip().splitlines()) + "\n"
    return shown, place / "block" / "results" / "figures"


def main() -> int:
    """Carry out the commands, and keep output and figures."""
    with tempfile.TemporaryDirectory() as place:
        shown, figures = carry_out(Path(place))
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(_PRINTED.sub(lambda match: match[1] + shown + match[3], page), encoding="utf-8")
        shutil.rmtree(KEPT, ignore_errors=True)
        KEPT.mkdir(parents=True)
        for name in pictures():
            shutil.copyfile(figures / name, KEPT / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
