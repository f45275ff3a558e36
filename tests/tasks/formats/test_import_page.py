from __future__ import annotations

import re

from tasks.settings.load import load_project
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


def test_the_complete_example_of_a_trajectory_is_a_valid_project(tmp_path):
    page = (REPOSITORY / "docs" / "import.md").read_text(encoding="utf-8")
    examples = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    complete = next(text for text in examples if text.startswith("version"))
    drone = next(text for text in examples if "dji-mrk" in text)
    before, _, rest = complete.partition("[inputs.exposures]")
    with_drone = before + drone.replace('"P1"', '"UCE-80"') + rest[rest.index("[adjustment]") :]
    for text, format_name in ((complete, "sbet"), (with_drone, "rtklib")):
        for name in re.findall(r'"([\w.]+\.(?:csv|out|pos|MRK))"', text):
            (tmp_path / name).touch()
        (tmp_path / "project.toml").write_text(text, encoding="utf-8")
        project = load_project(tmp_path / "project.toml")
        assert project.inputs.exposures[0].format == format_name
