"""Forty deliveries through `aerocal serve` on SQLite: no error in a log, an outcome is one line."""

from __future__ import annotations

import re
import time
from collections import Counter
from pathlib import Path

import pytest

from tests.faults.projects import deliver
from tests.flows.conftest import write_block
from tests.service.served import served, until

pytestmark = [pytest.mark.fault, pytest.mark.timeout(3600)]

NUMBER = 40
#: What is wrong with every eighth project, in turn: file, what stands there, what is put there.
_SLIPS = (
    ("exposures.csv", "omega", "course"),
    ("control.csv", "point,", "name,"),
    ("project.toml", "min = 0.7, max = 1.3", "max = 0.01"),
    ("image_points.csv", "1_001,", "9_001,"),
    ("project.toml", "version = 1", "version = 7"),
)
_OUTCOME = re.compile(r"Flow run '(?P<project>block-\d\d) · .*' - Finished in state ")
_ENDED = {"Completed", "GateFailed", "InputError", "NotComputable", "Failed", "Crashed"}


def test_forty_deliveries_leave_no_error_in_any_log(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    expected = Counter({"Completed": NUMBER - len(_SLIPS), "InputError": len(_SLIPS) - 1, "GateFailed": 1})
    for number in range(NUMBER):
        folder = tmp_path / "made" / f"block-{number:02d}"
        write_block(folder)
        if number % 8 == 7:
            file, old, new = _SLIPS[number // 8]
            text = (folder / file).read_text()
            assert old in text
            (folder / file).write_text(text.replace(old, new))
    with served(tmp_path, "--limit", "2") as server:
        began = time.monotonic()
        for folder in sorted((tmp_path / "made").iterdir()):
            deliver(folder, tmp_path / "inbox")

        def ended() -> list[dict[str, object]]:
            runs = server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
            done = [run for run in runs if run["state_name"] in _ENDED]
            return done if len(done) == NUMBER else []

        runs = until(ended, 3000, server.process)
        wall_s = time.monotonic() - began
        assert Counter(run["state_name"] for run in runs) == expected
        assert {run["run_count"] for run in runs} == {1}
        # The last lines of an end are written after the server has been told.
        time.sleep(3)
        logs = {file: file.read_text() for file in (tmp_path / "state").rglob("*.log*")}
        logs[tmp_path / "printed"] = server.printed
    assert len(logs) >= 3
    lines = [line for text in logs.values() for line in text.splitlines()]
    for wrong in (r"\bERROR\b", r"\bCRITICAL\b", "Traceback", "database is locked", "unexpected exception"):
        found = [line for line in lines if re.search(wrong, line)]
        assert not found, found[:5]
    said = [_OUTCOME.search(line) for line in lines]
    outcomes = Counter(found["project"] for found in said if found is not None)
    assert outcomes == Counter(f"block-{number:02d}" for number in range(NUMBER))
    with capfd.disabled():
        print(f"\n{NUMBER} deliveries in {wall_s:.0f} s, {len(lines)} lines of {len(logs)} logs")
