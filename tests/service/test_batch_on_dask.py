"""Many projects on a real Dask cluster: the bytes of single runs, and the same environment everywhere."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.command_line import aerocal
from tests.flows.conftest import write_block
from tests.service.dask_cluster import DaskCluster, dask_cluster

pytestmark = pytest.mark.service


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path_factory.mktemp("cluster")) as running:
        yield running


def digests(out: Path) -> dict[str, str]:
    """File name → digest of everything published."""
    artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}


def test_projects_on_a_cluster_have_the_bytes_of_a_run(running: DaskCluster, tmp_path: Path) -> None:
    alone, *others = (write_block(tmp_path / name) for name in ("alone", "one", "two", "wrong"))
    others[-1].with_name("control.csv").write_text("nonsense\n")
    assert aerocal("run", alone, "--server", "none").returncode == 0
    done = aerocal("batch", *others, "--dask", running.address, "--json")
    assert done.returncode == 2, done.stderr
    assert "2 workers" in done.stderr
    assert [row["status"] for row in json.loads(done.stdout)] == ["done", "done", "input_error"]
    for project in others[:-1]:
        assert digests(project.parent / "results") == digests(alone.parent / "results")
        assert not list((project.parent / "results").glob(".*.tmp"))


def test_workers_with_another_environment_are_refused(running: DaskCluster, tmp_path: Path) -> None:
    project = write_block(tmp_path / "block")
    project.write_text(project.read_text().replace('"control.csv"', '"${FLIGHTS}/control.csv"'))
    here = {"FLIGHTS": str(project.parent)}
    done = aerocal("batch", project, "--dask", running.address, **here)
    assert done.returncode == 1
    assert "has FLIGHTS set differently from this run" in done.stderr
    assert not (project.parent / "results" / ".store").exists()
