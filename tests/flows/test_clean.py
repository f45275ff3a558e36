"""`aerocal clean` as its users meet it, on the results of real runs."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from flows.command.main import app
from flows.runs.project_run import RunRequest, carry_out
from tasks.store.run_lock import run_lock
from tasks.store.stage_record import read_records
from tasks.store.store import Store
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.conftest import write_block

DAY = 86_400


def clean(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["clean", *map(str, arguments)], env={"COLUMNS": "200"})


def run(block: Path, *overrides: str) -> list[str]:
    """Run the block; the stages that were computed."""
    request = RunRequest(block, overrides=overrides)
    assert carry_out(adjustment_alone, request).error is None
    return [one.stage for one in read_records(Store.of(request.directory).folder) if not one.reused]


def age(results: Path, days: float) -> None:
    for file in results.glob(".store/*/*/stage.json"):
        then = file.stat().st_mtime - days * DAY
        os.utime(file, (then, then))


def published(results: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in results.iterdir() if path.is_file()}


@pytest.fixture(scope="module")
def three_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a block with the results of three runs with other settings."""
    block = write_block(tmp_path_factory.mktemp("runs") / "block")
    for critical in (3.5, 3.8, 4.13):
        run(block, f"adjustment.rejection.critical_value={critical}")
    return block.parent


@pytest.fixture
def block(three_runs: Path, tmp_path: Path) -> Path:
    """The project file of a copy."""
    return Path(shutil.copytree(three_runs, tmp_path / "block")) / "project.toml"


@pytest.fixture
def results(block: Path) -> Path:
    """Results of the three runs, the last of which is published, a hundred days ago."""
    folder = block.parent / "results"
    age(folder, 100)
    return folder


def test_what_the_last_run_needs_stays_and_the_rest_goes(block: Path, results: Path) -> None:
    before, stores = published(results), set(results.glob(".store/*/*"))
    looked = clean(results, "--dry-run")
    assert looked.exit_code == 0, looked.stderr
    assert "Would remove" in looked.stdout
    assert set(results.glob(".store/*/*")) == stores
    done = clean(block.parent)
    assert done.exit_code == 0, done.stderr
    assert looked.stdout.replace("Would remove", "Removed") == done.stdout
    assert len(list(results.glob(".store/bundle_adjustment/*"))) == 1
    assert published(results) == before
    assert run(block, "adjustment.rejection.critical_value=4.13") == []
    assert published(results).keys() == before.keys()
    again = clean(results)
    assert "Removed 0 stored outputs and 0 leftovers" in again.stdout
    assert "bundle_adjustment" in run(block, "adjustment.rejection.critical_value=3.5")


def test_json_names_every_output_and_why_others_stay(results: Path) -> None:
    found = json.loads(clean(results, "--dry-run", "--json").stdout)
    assert found["removed"] is False
    (folder,) = found["folders"]
    assert found["freed_bytes"] == folder["freed_bytes"] == sum(one["bytes"] for one in folder["outputs"]) > 0
    assert {one["because"] for one in folder["kept"]} == {"named"}
    assert {one["stage"] for one in folder["outputs"]} >= {"bundle_adjustment"}


def test_what_was_used_within_the_time_stays(results: Path) -> None:
    assert "Would remove 0 stored outputs" in clean(results, "--older-than", "101", "--dry-run").stdout
    assert "Would remove 0 stored outputs" not in clean(results, "--older-than", "99", "--dry-run").stdout


def test_a_folder_in_use_and_one_with_a_damaged_manifest_are_remarked_on(block: Path, results: Path) -> None:
    with run_lock(results):
        done = clean(block.parent)
        assert done.exit_code == 0
        assert f"{results}: A run is writing to it: nothing is removed." in done.stderr
    (results / "manifest.json").write_text("{")
    done = clean(block.parent)
    assert f"{results}: Its manifest.json cannot be read: nothing is removed." in done.stderr
    assert "Removed 0 stored outputs" in done.stdout


def test_a_folder_that_does_not_exist_is_an_input_error(tmp_path: Path) -> None:
    done = clean(tmp_path / "nowhere")
    assert done.exit_code == 2
    assert "There is no folder" in done.stderr
    assert "from 0 output folders" in clean(tmp_path).stdout
