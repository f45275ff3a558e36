"""Many projects at a time: each as if it had been run alone, whatever becomes of the others."""

from __future__ import annotations

import json
import multiprocessing
import shutil
from pathlib import Path
from typing import NoReturn

import pytest

from tests.command_line import aerocal
from tests.flows.stories.test_two_step_calibration import delivered


def digests(out: Path) -> dict[str, str]:
    """File name → digest of everything published."""
    artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}


def copy_of(block: Path, name: str, beside: Path | None = None) -> Path:
    """The same block in a folder of its own, beside this or another one; its project file."""
    folder = (beside or block).parent.with_name(name)
    shutil.copytree(block.parent, folder)
    return folder / block.name


def changed(project: Path, old: str, new: str) -> None:
    text = project.read_text()
    assert old in text
    project.write_text(text.replace(old, new))


@pytest.fixture
def projects(block: Path, run_before: Path) -> dict[str, Path]:
    """One that is done, one that was and fails a gate now, one whose input is wrong, one without datum."""
    found = {
        "fine": copy_of(block, "fine"),
        "gated": copy_of(run_before / block.name, "gated", beside=block),
        "wrong": copy_of(block, "wrong"),
        "floating": copy_of(block, "floating"),
    }
    changed(found["gated"], "sigma0 = { min = 0.7, max = 1.3 }", "sigma0 = { max = 0.1 }")
    changed(found["wrong"].with_name("control.csv"), "point,x", "pint,x")
    changed(found["floating"], "[inputs.control]", "[unused]")
    return found


def test_one_that_fails_stops_no_other_and_every_end_is_told(
    run_before: Path, projects: dict[str, Path]
) -> None:
    floating = projects.pop("floating")
    missing = floating.with_name("missing.toml")
    done = aerocal("batch", *projects.values(), missing, "--workers", "2", "--json")
    assert done.returncode == 2, done.stderr
    rows = json.loads(done.stdout)
    assert [Path(row["project"]).parent.name for row in rows] == ["fine", "gated", "wrong", "floating"]
    assert [row["status"] for row in rows] == ["done", "gate_failed", "input_error", "input_error"]
    assert [row["exit_code"] for row in rows] == [0, 4, 2, 2]
    fine, gated, wrong, _ = rows
    summary = json.loads((projects["fine"].parent / "results" / "summary.json").read_text())
    assert (fine["sigma0"], fine["rmse_check_m"]) == (summary["sigma0"], summary["rmse_check_m"])
    assert gated["gates_failed"] == ["sigma0"]
    assert "control.csv" in wrong["error"]
    assert "batch: 4 of 4: " in done.stderr
    assert "Traceback" not in done.stderr
    # A mistyped project leaves no folder of results.
    assert not (floating.parent / "results").exists()
    # A worker has written the bytes of a run.
    assert digests(projects["fine"].parent / "results") == digests(run_before / "results")


def test_a_batch_goes_on_where_it_stood(warm_block: Path) -> None:
    block, other = warm_block, copy_of(warm_block, "other")
    shutil.rmtree(other.parent / "results")
    done = aerocal("batch", block.parent, other.parent, "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert all(project.parent.name in done.stdout for project in (block, other))
    reused = [
        {
            stage["reused"]
            for stage in json.loads((p.parent / "results" / "manifest.json").read_text())["stages"]
        }
        for p in (block, other)
    ]
    assert reused == [{True}, {False}]


def test_two_projects_that_would_share_a_folder_are_refused(block: Path) -> None:
    second = block.with_name("second.toml")
    second.write_text(block.read_text())
    done = aerocal("batch", block, second)
    assert done.returncode == 2
    assert "would go into the same folder" in done.stderr
    assert not (block.parent / "results").exists()


def test_a_folder_that_cannot_be_written_fails_alone(warm_block: Path) -> None:
    other = copy_of(warm_block, "other")
    shutil.rmtree(other.parent / "results")
    (other.parent / "results").mkdir()
    (other.parent / "results" / ".store").write_text("a file where a folder should be")
    done = aerocal("batch", other, warm_block, "--workers", "1", "--json")
    assert done.returncode == 1
    rows = json.loads(done.stdout)
    assert [row["status"] for row in rows] == ["failed", "done"]
    assert "cannot be written" in rows[0]["error"]


def test_a_file_in_the_place_of_a_folder_is_wrong_input_of_its_project_alone(warm_block: Path) -> None:
    other = copy_of(warm_block, "other")
    shutil.rmtree(other.parent / "results")
    (other.parent / "results").write_text("a file where the folder should be")
    done = aerocal("batch", other, warm_block, "--workers", "1", "--json")
    assert done.returncode == 2
    rows = json.loads(done.stdout)
    assert [row["status"] for row in rows] == ["input_error", "done"]
    assert "This is a file, not a folder." in rows[0]["error"]
    assert "--out" not in rows[0]["error"]


def test_projects_that_are_not_there_share_no_folder(block: Path) -> None:
    done = aerocal("batch", block.with_name("one.toml"), block.with_name("two.toml"), "--json")
    assert done.returncode == 2
    assert ["no such project file" in row["error"] for row in json.loads(done.stdout)] == [True, True]


def test_no_more_workers_are_started_than_there_are_projects(
    block: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> NoReturn:
        raise AssertionError("a process was started")

    monkeypatch.setattr(multiprocessing, "get_context", refused)
    changed(block.with_name("control.csv"), "point,x", "pint,x")
    done = aerocal("batch", block, block.with_name("missing.toml"), "--workers", "2", "--json")
    assert [row["exit_code"] for row in json.loads(done.stdout)] == [2, 2]


def test_each_project_runs_what_its_file_declares(tmp_path: Path) -> None:
    """A calibration, here of delivered orientations alone, the quickest there is."""
    project = delivered(tmp_path)
    done = aerocal("batch", project, "--workers", "1", "--json")
    alone = aerocal("run", project, "--json", "--out", tmp_path / "alone")
    assert json.loads(done.stdout)[0]["exit_code"] == alone.returncode == 0
    assert digests(tmp_path / "results") == digests(tmp_path / "alone")
    assert (tmp_path / "results" / "orientation_differences.parquet").exists()


@pytest.mark.parametrize("name", ["../elsewhere", "..", ".", ""])
def test_the_name_of_the_output_folder_is_a_name(block: Path, name: str) -> None:
    before = sorted(block.parent.parent.rglob("*"))
    done = aerocal("batch", block, "--output", name)
    assert done.returncode == 2
    assert "is not the name of a folder" in done.stderr
    assert sorted(block.parent.parent.rglob("*")) == before
