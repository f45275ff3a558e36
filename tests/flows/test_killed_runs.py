"""A run that is killed at any moment leaves nothing that a later run could take for a result."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Start

TRIALS = 12


def start_run(start: Start, block: Path, out: Path) -> subprocess.Popen[str]:
    command = (sys.executable, "-m", "flows.command", "run", block, "--out", out)
    return start(*command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def digests(out: Path) -> dict[str, str]:
    """File name → digest of everything published."""
    artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_killed_runs_never_spoil_a_later_one(start: Start, block: Path, tmp_path: Path) -> None:
    assert start_run(start, block, tmp_path / "warm").wait() == 0
    started = time.monotonic()
    assert start_run(start, block, tmp_path / "undisturbed").wait() == 0
    whole = time.monotonic() - started
    expected = digests(tmp_path / "undisturbed")
    moments = random.Random(7)
    for trial in range(TRIALS):
        out = tmp_path / f"trial-{trial}"
        for _ in range(2):
            process = start_run(start, block, out)
            time.sleep(moments.uniform(0.3, 1.0) * whole)
            process.send_signal(signal.SIGKILL)
            process.wait()
        assert start_run(start, block, out).wait() == 0
        assert digests(out) == expected
        names = {path.name for path in out.iterdir()}
        assert names == set(expected) | {"summary.json", "manifest.json", ".store"}
        assert not list((out / ".store").glob("*/.*"))
