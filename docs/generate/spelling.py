"""Check the spelling of the pages: ``python -m docs.generate.spelling``, in the environment of ``make docs``.

Words that neither the dictionary nor ``docs/words.txt`` has are listed with file and line. Code, links and
names in backquotes are not checked. ``--add`` writes them into the list: only after each of them has been
read.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from spellchecker import SpellChecker

ROOT = Path(__file__).resolve().parents[2]
WORDS = ROOT / "docs" / "words.txt"
_CODE = re.compile(r"^(```|~~~).*?^\1$|`[^`\n]*`|<!--.*?-->|\$[^$\n]+\$", re.DOTALL | re.MULTILINE)
_ADDRESS = re.compile(r"\]\([^)\s]*\)|<https?:[^>]*>|https?://\S+|\S+@\S+")
# Letters of this alphabet; what has digits, other letters or capitals inside is a name or a formula.
_WORD = re.compile(r"(?<![\w/.\\’'-])([A-Z]?[a-z]{3,})(?:['’]s)?(?![\w/\\]|\.\w)")


def pages() -> Iterator[Path]:
    """Every page of the repository."""
    yield from sorted(ROOT.glob("*.md"))
    for folder in ("docs", "examples", "benchmarks"):
        yield from sorted(path for path in (ROOT / folder).rglob("*.md") if "api" not in path.parts)


def words_of(text: str) -> Iterator[tuple[int, str]]:
    """Words of a page with their line numbers."""
    blank = _CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    blank = _ADDRESS.sub(lambda match: " " * len(match[0]), blank)
    for number, line in enumerate(blank.splitlines(), start=1):
        yield from ((number, match[1]) for match in _WORD.finditer(line))


def unknown_words() -> dict[str, list[str]]:
    """Words that are not known, each with the places where it stands."""
    checker = SpellChecker(language="en", distance=1)
    checker.word_frequency.load_words(WORDS.read_text(encoding="utf-8").split())
    found: dict[str, list[str]] = {}
    for page in pages():
        for line, word in words_of(page.read_text(encoding="utf-8")):
            if not checker.known([word.lower()]):
                found.setdefault(word.lower(), []).append(f"{page.relative_to(ROOT)}:{line}")
    return found


def main() -> int:
    """List what is not known; 1 if there is anything."""
    found = unknown_words()
    if "--add" in sys.argv:
        known = {*WORDS.read_text(encoding="utf-8").split(), *found}
        WORDS.write_text("\n".join(sorted(known)) + "\n", encoding="utf-8")
        return 0
    for word, places in sorted(found.items()):
        print(f"{places[0]}: {word}" + (f" ({len(places)} times)" if len(places) > 1 else ""))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
