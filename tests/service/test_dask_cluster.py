"""Stages carried out by a real Dask cluster: what an executor promises, and what may go wrong."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from flows.runs import cluster as module
from flows.runs.cluster import cluster
from flows.runs.stage import stage
from tasks.errors import InputError, NotComputableError
from tasks.files.installation import InstallationError
from tasks.store.artifact import verified
from tasks.store.store import Store, stored
from tests.ports import free_port
from tests.service.dask_cluster import REPOSITORY, DaskCluster, dask_cluster
from tests.service.served import until

pytestmark = pytest.mark.service


@stored("letters")
def write_letters(folder: Path, *, text: str) -> None:
    """Ends in the ways a stage may, as the text says."""
    if text == "wrong":
        raise InputError(what="The text is wrong.", remedy="Write another.", file=Path("x"), line=3)
    if text == "undetermined":
        raise NotComputableError(what="The datum is open.")
    if text == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    if text == "defect":
        raise ValueError("a defect")
    if text.startswith("slow"):
        time.sleep(0.3)
    if text == "long":
        (folder / "begun").touch()
        time.sleep(60.0)
    (folder / "text.txt").write_text(f"{text} {os.getpid()} {os.environ['AEROCAL_THREADS']}")


letters = stage(write_letters)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path_factory.mktemp("cluster")) as running:
        yield running


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store.of(tmp_path / "results")
    store.begin_run()
    return store


def attempted(address: str, store: Store, *texts: str) -> tuple[object, ...]:
    with cluster(address, (store.folder,)) as executor:
        return letters.attempt([{"text": text} for text in texts], store, executor=executor)


def test_the_workers_do_the_stages_and_errors_come_back_whole(running: DaskCluster, store: Store) -> None:
    first, wrong, second, undetermined, again = attempted(
        running.address, store, "a", "wrong", "b", "undetermined", "a"
    )
    assert first == again
    assert isinstance(wrong, InputError)
    assert str(wrong) == "x:3: The text is wrong. Write another."
    assert isinstance(undetermined, NotComputableError)
    assert isinstance(second, dict)
    text, pid, threads = verified(second["text"]).read_text().split()
    assert (text, threads) == ("b", "1")
    assert int(pid) in {worker.pid for worker in running.workers}
    assert os.getenv("AEROCAL_THREADS") is None
    assert not list(store.folder.glob(".*"))


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_inside_a_flow_run_every_call_is_a_task_carried_out_by_the_cluster(
    running: DaskCluster, store: Store
) -> None:
    from prefect import flow

    @flow(name="on a cluster", persist_result=False)
    def as_flow(address: str) -> tuple[object, ...]:
        return attempted(address, store, "a", "wrong")

    done, wrong = as_flow(running.address)
    assert isinstance(done, dict)
    _text, pid, _threads = verified(done["text"]).read_text().split()
    assert int(pid) in {worker.pid for worker in running.workers}
    assert str(wrong) == "x:3: The text is wrong. Write another."


def test_a_defect_in_a_worker_ends_everything(running: DaskCluster, store: Store) -> None:
    with pytest.raises(ValueError, match="a defect"):
        attempted(running.address, store, "defect")


def interrupted_after_the_first(address: str, store: Store, texts: list[str]) -> None:
    def interrupt(_index: int, _outcome: object) -> None:
        raise KeyboardInterrupt

    with cluster(address, (store.folder,)) as executor:
        letters.attempt([{"text": text} for text in texts], store, executor=executor, when_done=interrupt)


def test_an_interrupt_calls_off_what_no_worker_has_begun(running: DaskCluster, store: Store) -> None:
    texts = [f"slow {number}" for number in range(20)]
    with pytest.raises(KeyboardInterrupt):
        interrupted_after_the_first(running.address, store, texts)
    # The workers finish what they have started, and take up something else.
    attempted(running.address, store, "a")
    assert len(list(store.folder.glob("letters/*/text.txt"))) < 10


def test_workers_that_do_not_see_the_same_files_are_refused(
    running: DaskCluster, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # The same path for everybody, and behind it another folder for every process.
    with (
        pytest.raises(InstallationError, match="does not see what this run writes to /proc/self/cwd"),
        cluster(running.address, (store.folder, Path("/proc/self/cwd"))),
    ):
        pass
    assert not list(tmp_path.glob(".*"))


def test_a_scheduler_that_is_not_there_is_said_so(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_CONNECT_S", 1.0)
    for address in (f"tcp://127.0.0.1:{free_port('127.0.0.1')}", "nowhere", "carrier-pigeon://loft:1"):
        with pytest.raises(InstallationError, match=f"scheduler {address} cannot be reached") as caught:
            attempted(address, store, "a")
        assert "dask scheduler" in caught.value.remedy


def test_workers_that_cannot_take_part_are_refused_before_anything_is_computed(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_FIRST_WORKER_S", 0.2)
    other, empty = tmp_path / "other", tmp_path / "empty"
    for package in ("flows", "tasks", "adjust"):
        shutil.copytree(REPOSITORY / package, other / package, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "tasks" / "tables" / "parquet.py").open("a") as source:
        source.write("# Another version.\n")
    (empty / "flows" / "runs").mkdir(parents=True)
    (empty / "flows" / "__init__.py").touch()
    for name in ("__init__.py", "cluster_worker.py"):
        (empty / "flows" / "runs" / name).touch()
    with dask_cluster(tmp_path / "cluster", workers=0) as running:
        with pytest.raises(InstallationError, match="has no workers"):
            attempted(running.address, store, "a")
        for options, path, words in (
            (("--nthreads", "2"), REPOSITORY, "has 2 threads"),
            ((), other, "other source files of aerocal"),
            ((), empty, "cannot load the version of aerocal used here"),
        ):
            pid = running.add_worker(*options, environment={"PYTHONPATH": str(path)})
            with pytest.raises(InstallationError, match=words):
                attempted(running.address, store, "a")
            running.kill_worker(pid)
    assert not (store.folder / "letters").exists()


def test_a_worker_that_joins_in_the_middle_is_examined_too(store: Store, tmp_path: Path) -> None:
    with (
        dask_cluster(tmp_path / "cluster", workers=1) as running,
        cluster(running.address, (store.folder,)) as executor,
    ):
        assert executor.submit(os.getpid).result() == running.workers[0].pid
        running.add_worker("--nthreads", "2")
        running.kill_worker(running.workers[0].pid)
        with pytest.raises(InstallationError, match="has 2 threads"):
            executor.submit(os.getpid).result()


def test_work_that_kills_its_workers_is_given_up(store: Store, tmp_path: Path) -> None:
    once = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with (
        dask_cluster(tmp_path / "cluster", workers=1, environment=once) as running,
        pytest.raises(InstallationError, match="died repeatedly on the same task"),
    ):
        attempted(running.address, store, "deadly")


def lost_in_the_middle(running: DaskCluster, store: Store, lose: Callable[[], None]) -> None:
    """Have something done that takes a minute, and lose what it needs once it has started."""
    with cluster(running.address, (store.folder,)) as executor:
        future = executor.submit(write_letters, store, text="long")
        until(lambda: list(store.folder.glob("letters/*/begun")), 20.0)
        lose()
        future.result()


def test_a_scheduler_that_ends_in_the_middle_is_said_so(store: Store, tmp_path: Path) -> None:
    with (
        dask_cluster(tmp_path / "cluster", workers=1) as running,
        pytest.raises(InstallationError, match="stopped or was restarted"),
    ):
        lost_in_the_middle(running, store, running.scheduler.kill)


def test_nobody_waits_for_ever_for_workers_that_do_not_come_back(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_LOOK_S", 0.2)
    monkeypatch.setattr(module, "_WAIT_S", 1.0)
    with (
        dask_cluster(tmp_path / "cluster", workers=1) as running,
        pytest.raises(InstallationError, match="none has returned"),
    ):
        lost_in_the_middle(running, store, lambda: running.kill_worker(running.workers[0].pid))
