"""The stages that the production page expects are those that the stories come to, in that order."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

import tasks.stages
from flows.runs.project_run import RunRequest
from flows.runs.recorded_run import FlowRunIdentity, carry_out_recorded
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from tasks.production.board import Board, ProjectRow
from tasks.production.records import configured_records
from tasks.production.stages import STAGES, stages_of
from tests.flows.conftest import write_block

RECORDS = "AEROCAL_RECORDS"


@pytest.fixture
def block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(RECORDS, str(tmp_path / "records.sqlite"))
    write_block(tmp_path / "block")
    return tmp_path / "block" / "project.toml"


def recorded(story: Callable[..., object], name: str, file: Path, *overrides: str) -> ProjectRow:
    carry_out_recorded(story, RunRequest(file, overrides=overrides), FlowRunIdentity(name, name))  # type: ignore[arg-type]
    records = configured_records()
    assert records is not None
    return next(row for row in Board(records).changes(None).rows if row.run.id == name)


@pytest.mark.parametrize(
    ("story", "name", "overrides"),
    [
        (aerial_triangulation, "aerial-triangulation", ()),
        (
            direct_georeferencing_check,
            "direct-georeferencing-check",
            ("direct_georeferencing.calibration=adjustment",),
        ),
    ],
)
def test_a_story_comes_to_the_stages_it_is_known_for(
    block: Path, story: Callable[..., object], name: str, overrides: tuple[str, ...]
) -> None:
    row = recorded(story, name, block, *overrides)
    assert tuple(row.stages) == stages_of(name)
    assert set(row.stages.values()) == {"done"}
    assert {Path(file).name for file in (block.parent / "results").iterdir()} >= set(row.documents)
    assert row.documents


def test_a_run_that_is_refused_before_its_first_stage_has_none_of_the_run_before(block: Path) -> None:
    recorded(aerial_triangulation, "aerial-triangulation", block)
    begun = datetime.now(UTC)
    row = recorded(direct_georeferencing_check, "refused", block, "project.crs=EPSG:1")
    assert row.run.state == "InputError"
    assert row.run.ended is not None
    assert row.run.ended >= begun
    assert not {"done", "reused"} & set(row.stages.values())


def test_every_stage_of_a_run_has_a_row() -> None:
    named = {
        function.stage
        for module in pkgutil.iter_modules(tasks.stages.__path__)
        for function in vars(importlib.import_module(f"tasks.stages.{module.name}")).values()
        if isinstance(getattr(function, "stage", None), str)
    }
    # The doctor's own is of no run.
    assert named - {"diagnosis"} == set(STAGES)
