"""`aerocal run` does what the project file declares."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest
from tests.command_line import aerocal
from tests.conftest import PROJECT


@pytest.mark.parametrize(
    ("declared", "story"),
    [
        ("", "aerial_triangulation"),
        ("[direct_georeferencing]\ncalibration = 'adjustment'\n", "direct_georeferencing_check"),
        ("[calibration]\n", "system_calibration"),
        ("[calibration]\n[direct_georeferencing]\ncalibration = 'adjustment'\n", "system_calibration"),
        ("[calibration", "aerial_triangulation"),
    ],
)
def test_tables_of_the_project_file_say_what_is_run(tmp_path: Path, declared: str, story: str) -> None:
    for name in ("image_points.csv", "exposures.csv"):
        (tmp_path / name).write_text("")
    file = tmp_path / "project.toml"
    file.write_text(PROJECT + declared)
    assert RunRequest(file).declared_story() == story


def test_run_checks_where_a_check_is_declared_and_adjust_does_not(block: Path) -> None:
    with block.open("a") as stream:
        stream.write('[direct_georeferencing]\ncalibration = "adjustment"\n')
    for command, checks in (("run", True), ("adjust", False)):
        out = block.parent / command
        assert aerocal(command, block, "--out", out).returncode == 0
        summary = json.loads((out / "summary.json").read_text())
        assert (summary["direct_georeferencing"] is not None) == checks
        assert (out / "georeferencing_check.html").exists() == checks
