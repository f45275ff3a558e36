"""A sweep on one process, on two, and on a Dask cluster that loses a worker: the same bytes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import pytest

from tasks.store.stage_record import StageRecord, read_records
from tests.service.dask_cluster import REPOSITORY, dask_cluster

pytestmark = pytest.mark.service

AEROCAL = [sys.executable, "-m", "flows.command"]
SCENARIOS = 12
FIELD = """
preset = "uce-testfield"
[project]
name = "small field"
observe = ["control"]
[[flight]]
name = "E"
flight = "low"
height_m = 780.0
heading_deg = 90.0
lines = 2
exposures = 5
[[flight]]
name = "H"
flight = "high"
height_m = 1560.0
heading_deg = 0.0
lines = 1
exposures = 4
[points]
count = 250
[control]
columns = 4
rows = 3
extent_m = [1100.0, 900.0]
"""
# In place of the scenarios of the preset, which would be added to those of a specification.
CHOSEN = (
    'sweep.blocks={low=["low"], both=["low", "high"]}',
    'sweep.control={all="all", five={count=5}}',
    'sweep.parameters=["none", "bluh:1-12"]',
    'sweep.variants={loose={"inputs.control.sigma_m"=0.2}}',
)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("field")
    (folder / "spec.toml").write_text(FIELD)
    with started("simulate", folder / "spec.toml", "--out", folder / "project") as process:
        assert process.wait() == 0
    return folder / "project" / "project.toml"


def started(*arguments: str | Path, more: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    return subprocess.Popen(
        [*AEROCAL, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**kept, "PYTHONPATH": str(REPOSITORY), **(more or {})},
    )


def printed_until(process: subprocess.Popen[str], words: str) -> str:
    """What it prints on stderr up to a line with these words."""
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        lines.append(line)
        if words in line:
            break
    return "".join(lines)


def sweeping(
    field: Path, out: Path, *options: str, more: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    chosen = [word for value in CHOSEN for word in ("--set", value)]
    return started("sweep", field, "--out", out, "--server", "none", *chosen, *options, more=more)


def swept(field: Path, out: Path, *options: str) -> None:
    with sweeping(field, out, *options) as process:
        _, errors = process.communicate(timeout=200)
    assert process.returncode == 0, errors


def adjustments(out: Path) -> list[StageRecord]:
    return [record for record in read_records(out / ".store") if record.stage == "bundle_adjustment"]


@pytest.mark.timeout(400)
def test_a_killed_worker_changes_no_byte_of_a_sweep(field: Path, tmp_path: Path) -> None:
    one, two, dask = (tmp_path / name for name in ("one", "two", "dask"))
    swept(field, one, "--set", "sweep.workers=1")
    swept(field, two, "--set", "sweep.workers=2")
    with (
        dask_cluster(tmp_path / "cluster") as cluster,
        sweeping(field, dask, more={"AEROCAL_DASK": cluster.address}) as process,
    ):
        errors = printed_until(process, f"sweep: 1 of {SCENARIOS}")
        cluster.kill_worker(cluster.workers[0].pid)
        errors += process.communicate(timeout=200)[1]
    assert process.returncode == 0, errors
    assert "2 workers" in errors
    for name in ("sweep.parquet", "sweep.html"):
        assert (dask / name).read_bytes() == (one / name).read_bytes() == (two / name).read_bytes()
    # What the killed worker had finished and handed over is not done again.
    times = Counter(record.key for record in adjustments(dask))
    assert len(times) == SCENARIOS
    assert sum(times.values()) <= SCENARIOS + 1


@pytest.mark.timeout(400)
def test_an_interrupted_sweep_on_a_cluster_goes_on_where_it_stood(field: Path, tmp_path: Path) -> None:
    with dask_cluster(tmp_path / "cluster") as cluster:
        with sweeping(field, tmp_path / "out", "--dask", cluster.address) as process:
            printed_until(process, f"sweep: 1 of {SCENARIOS}")
            process.send_signal(signal.SIGINT)
            errors = process.communicate(timeout=60)[1]
        assert process.returncode == 130
        assert "Interrupted; completed stages are kept" in errors
        assert "Traceback" not in errors
        assert not (tmp_path / "out" / "sweep.parquet").exists()
        swept(field, tmp_path / "out", "--dask", cluster.address)
    assert sum(record.reused for record in adjustments(tmp_path / "out")) >= 1
    assert (tmp_path / "out" / "sweep.parquet").is_file()


def test_a_lost_cluster_ends_a_sweep_in_one_sentence(field: Path, tmp_path: Path) -> None:
    with (
        dask_cluster(tmp_path / "cluster", workers=1) as cluster,
        sweeping(field, tmp_path / "out", "--dask", cluster.address) as process,
    ):
        printed_until(process, f"sweep: 1 of {SCENARIOS}")
        cluster.scheduler.kill()
        errors = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "stopped or was restarted during the computation." in errors
    assert "Traceback" not in errors
