"""Every command of the tutorial is executed, with the values declared that the page declares."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from tests.command_line import aerocal
from tests.docs.own_deliveries import Block, classical, metashape, open_source

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorial-own-data.md"
_FENCE = re.compile(r"^```(sh|toml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_ENDS = re.compile(r"# ends with (\d)")
FOLDERS = {"block7": classical, "odm": open_source, "metashape": metashape}


def steps(folder: str) -> Iterator[tuple[str, str]]:
    """Kind and text of the blocks of the section about a folder."""
    section = next(
        part for part in PAGE.read_text(encoding="utf-8").split("\n## ") if f"aerocal init {folder}\n" in part
    )
    for found in _FENCE.finditer(section):
        yield found[1], found[2]


def declare(project: Path, snippet: str) -> None:
    """Put values into the tables of a project file, each in the place of a text that begins with DECLARE."""
    table, lines = "", project.read_text(encoding="utf-8").splitlines()
    wanted: dict[tuple[str, str], str] = {}
    for line in snippet.splitlines():
        table = line if line.startswith("[") else table
        if " = " in line:
            wanted[table, line.split(" = ")[0]] = line
    for number, line in enumerate(lines):
        table = line if line.startswith("[") else table
        if " = " in line and "DECLARE" in line and (table, line.split(" = ")[0]) in wanted:
            lines[number] = wanted.pop((table, line.split(" = ")[0]))
    for (table, _), line in wanted.items():
        assert table not in lines, f"this was not asked: {line}"
        lines += ["", table, line]
    project.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "DECLARE:" not in json.dumps(tomllib.loads("\n".join(lines)))


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Block:
    return Block(tmp_path_factory.mktemp("simulated"))


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_command_of_the_tutorial(
    block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    monkeypatch.chdir(tmp_path)
    FOLDERS[folder](block, tmp_path / folder)
    commands = 0
    for kind, text in steps(folder):
        if kind == "toml":
            declare(tmp_path / folder / "project.toml", text)
            continue
        for line in text.splitlines():
            expected = int(found[1]) if (found := _ENDS.search(line)) else 0
            done = aerocal(*shlex.split(line, comments=True)[1:])
            assert done.returncode == expected, (line, done.stdout, done.stderr)
            if " init " in line:
                _shows_what_the_page_shows(done.stdout, folder)
            if " doctor " in line:
                assert ("mistake" in done.stdout) == bool(expected), done.stdout
            commands += 1
    assert commands >= 4
    _agrees_with_the_truth(block, tmp_path / folder / "results")
    (delivery,) = (tmp_path / folder / "results" / "export").iterdir()
    assert (delivery / "HANDOVER.txt").exists()


def _shows_what_the_page_shows(printed: str, folder: str) -> None:
    """The table of files that the page shows for the first folder."""
    if folder == "block7":
        shown = PAGE.read_text(encoding="utf-8").split("```\nfile  ")[1].split("```")[0]
        for line in shown.splitlines()[2:]:
            assert line.split() in [row.split() for row in printed.splitlines()], line


def _agrees_with_the_truth(block: Block, results: Path) -> None:
    """Positions within five of their standard deviations, which is what the delivery can hold."""
    names = ["x_m", "y_m", "z_m"]
    found = pd.read_parquet(results / "exterior_orientations.parquet").set_index("image")
    truth = pd.read_parquet(block.folder / "truth" / "exterior_orientations.parquet").set_index("image")
    assert len(found) == 20
    difference = (found[names] - truth.loc[found.index, names]).to_numpy()
    sigma = found[[f"sigma_{name}" for name in names]].to_numpy()
    assert (abs(difference) < 5.0 * sigma).all(), abs(difference / sigma).max()
    assert sigma.max() < 1.0
