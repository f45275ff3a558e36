"""Many projects, two runners, PostgreSQL: none lost, none twice, the bytes of a run by hand."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from pathlib import Path

import pytest

from tests.faults.production import production, seconds_since
from tests.faults.projects import deliver, published, simulated

pytestmark = [pytest.mark.fault, pytest.mark.timeout(7200)]

NUMBER = int(os.environ.get("AEROCAL_FAULT_PROJECTS", "50"))


def test_every_project_ends_once_as_a_run_by_hand(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    expected = simulated(tmp_path / "made", NUMBER)
    with production(tmp_path) as running:
        started = time.monotonic()
        for project in expected:
            deliver(tmp_path / "made" / project.name, running.inbox)
        runs = running.all_ended([project.name for project in expected], 60.0 * NUMBER + 600)
        wall_s = seconds_since(started)
        for project in expected:
            run, out = runs[project.name], running.inbox / project.name / "results"
            assert (project.name, run.state) == (project.name, project.state), run.message
            assert run.message
            assert published(out) == project.digests, project.name
            adjusted = out / ".store" / "bundle_adjustment"
            assert len(list(adjusted.iterdir()) if adjusted.is_dir() else []) <= 1, "computed twice"
            running.told(run)
        assert len(running.records.runs()) == NUMBER, "a delivery has more than one run"
        found = running.server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
        assert len(found) == NUMBER
        assert {run["run_count"] for run in found} == {1}
        assert not running.checker.damaged
        overheads = sorted(
            (run.ended - run.begun).total_seconds() - sum(stage.seconds for stage in run.stages)
            for run in runs.values()
            if run.ended is not None and run.begun is not None
        )
    figures = {
        "projects": NUMBER,
        "wall_s": wall_s,
        "projects_per_hour": round(3600 * NUMBER / wall_s, 1),
        "states": dict(Counter(run.state for run in runs.values())),
        "faults": {project.fault: project.state for project in expected if project.fault},
        "by_hand_s": round(sum(project.seconds for project in expected), 1),
        "stages_s": round(sum(stage.seconds for run in runs.values() for stage in run.stages), 1),
        "overhead_in_run_s": {"median": overheads[len(overheads) // 2], "largest": overheads[-1]},
    }
    with capfd.disabled():
        print(f"\n{json.dumps(figures, indent=1)}")
        for name, value in figures.items():
            print(f"{name:20} {value}")
