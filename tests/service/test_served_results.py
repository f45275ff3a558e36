"""``aerocal serve --results``: deployed runs, and runs by hand beside them, put results on object storage."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.fetch import fetch_results
from tests.flows.conftest import write_block
from tests.service.served import served

pytestmark = [pytest.mark.service, pytest.mark.timeout(600), pytest.mark.usefixtures("server")]


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_results_of_the_server_are_beside_the_project_and_on_object_storage(
    address: ObjectAddress, tmp_path: Path
) -> None:
    block = write_block(tmp_path / "root" / "block")
    with served(tmp_path, "--results", str(address)) as running:
        run = running.ended(running.start("aerial-triangulation/manual", {"project": "block"}))
        assert run["state_name"] == "Completed", run["state"]["message"]
        fetch_results(address.below("root", "block", "results"), tmp_path / "deployed")
        assert tables(tmp_path / "deployed") == tables(block.parent / "results")
        by_hand = address.below("by-hand")
        command = [sys.executable, "-m", "flows.command", "run", str(block), "--out", str(by_hand)]
        done = subprocess.run(
            command, env=running.environment, capture_output=True, text=True, check=False, timeout=240
        )
        assert done.returncode == 0, done.stderr
        seen = running.runs(flow_runs={"name": {"any_": ["block/project.toml"]}})
        assert [one["state"]["message"] for one in seen] == [f"Results are in {by_hand}."]
    fetch_results(by_hand, tmp_path / "hand")
    assert tables(tmp_path / "hand") == tables(tmp_path / "deployed")
