from __future__ import annotations

from tests.conftest import REPOSITORY
from tests.tasks.formats.sound_files import READERS


def test_every_format_that_is_read_stands_on_its_page():
    page = (REPOSITORY / "docs" / "import.md").read_text(encoding="utf-8")
    for name in {name for readers in READERS.values() for name in readers} - {"csv"}:
        rows = [row for row in page.split("\n") if row.startswith("|") and f"`{name}`" in row.split("|")[1]]
        assert rows, name
        for kind, readers in READERS.items():
            stated = any(kind in row.split("|")[2] for row in rows)
            assert stated == (name in readers) or name.startswith("ign"), (name, kind)
