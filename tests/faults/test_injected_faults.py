"""Faults while projects are computed: after recovery all ends as by hand, nothing damaged is ever there."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tasks.production.run_record import RunRecord
from tests.faults.production import Production, production, seconds_since
from tests.faults.projects import Simulated, deliver, published, simulated
from tests.service.served import served, until

pytestmark = [pytest.mark.fault, pytest.mark.timeout(3600)]

#: Projects of each fault.
NUMBER = 3


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Production]:
    with production(tmp_path_factory.mktemp("faults")) as made:
        yield made


@pytest.fixture(scope="module")
def figures() -> Iterator[dict[str, dict[str, object]]]:
    found: dict[str, dict[str, object]] = {}
    yield found
    print(f"\n{json.dumps(found, indent=1)}")


_SEEDS = iter(range(100, 1000, 20))


def _outlasted(
    running: Production,
    figures: dict[str, dict[str, object]],
    fault: str,
    inject: Callable[[Production, RunRecord], None],
) -> dict[str, RunRecord]:
    """Deliver projects, inject a fault while one is computed, and hold the ends against runs by hand."""
    made = running.folder / f"made-{fault.replace(' ', '-')}"
    expected = simulated(made, NUMBER, next(_SEEDS))
    assert [project.fault is None for project in expected] == [True, True, False]
    started = time.monotonic()
    for project in expected:
        deliver(made / project.name, running.inbox)
    names = [project.name for project in expected]
    inject(running, running.one_running(names))
    recovering = time.monotonic()
    runs = running.all_ended(names, 900)
    figures[fault] = {
        "outcome": sorted({runs[name].state for name in names}),
        "attempts": [runs[name].attempts for name in names],
        "ended_after_recovery_s": seconds_since(recovering),
        "wall_s": seconds_since(started),
    }
    _hold(running, expected, runs)
    print(f"\n{fault}: {figures[fault]}")
    return runs


def _hold(running: Production, expected: list[Simulated], runs: dict[str, RunRecord]) -> None:
    for project in expected:
        run, out = runs[project.name], running.inbox / project.name / "results"
        assert run.state == project.state, run.message
        assert published(out) == project.digests
        adjusted = out / ".store" / "bundle_adjustment"
        assert len(list(adjusted.glob("[0-9a-f]*")) if adjusted.is_dir() else []) <= 1
        running.told(run)
    assert not running.checker.damaged
    assert running.checker.rounds > 0


def test_a_killed_engine(running: Production, figures: dict[str, dict[str, object]]) -> None:
    runs = _outlasted(
        running, figures, "engine killed", lambda _, run: os.kill(run.process or 0, signal.SIGKILL)
    )
    assert max(run.attempts for run in runs.values()) >= 2


def test_a_killed_runner(running: Production, figures: dict[str, dict[str, object]]) -> None:
    def kill(running: Production, _run: RunRecord) -> None:
        os.kill(running.server.group_of("flows.serving.deployments"), signal.SIGKILL)

    _outlasted(running, figures, "runner killed", kill)


def test_a_killed_server(running: Production, figures: dict[str, dict[str, object]]) -> None:
    def kill(running: Production, _run: RunRecord) -> None:
        os.kill(running.server.group_of("flows.server.prefect_server"), signal.SIGKILL)

    _outlasted(running, figures, "server killed", kill)


def test_a_killed_database(running: Production, figures: dict[str, dict[str, object]]) -> None:
    def kill(running: Production, _run: RunRecord) -> None:
        running.postgresql.kill()
        time.sleep(20)
        running.postgresql.start()

    _outlasted(running, figures, "database killed", kill)


def test_a_clock_that_jumps(running: Production, figures: dict[str, dict[str, object]]) -> None:
    clock = running.folder / "clock"
    clock.write_text("+0")
    library = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
    running.end_runner()
    running.runner = running.start_runner(
        LD_PRELOAD=str(library),
        FAKETIME_TIMESTAMP_FILE=str(clock),
        FAKETIME_NO_CACHE="1",
        FAKETIME_DONT_FAKE_MONOTONIC="1",
    )

    def jump(_running: Production, _run: RunRecord) -> None:
        clock.write_text("+2h")
        time.sleep(10)
        clock.write_text("-1h")

    _outlasted(running, figures, "clock jumps", jump)
    running.end_runner()
    running.runner = running.start_runner()


@contextmanager
def _small_disk(place: Path) -> Iterator[Path]:
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def test_a_full_disk(running: Production, figures: dict[str, dict[str, object]]) -> None:
    made = running.folder / "made-disk-full"
    (expected,) = simulated(made, 1, 4, faulty=False)
    delivery = running.inbox / expected.name
    with _small_disk(delivery):
        for file in (made / expected.name).iterdir():
            shutil.copy(file, delivery / file.name)
        started = time.monotonic()
        # Hidden, so that it is no part of what is delivered.
        (delivery / ".ballast").mkdir()
        with (delivery / ".ballast" / "file").open("wb") as ballast:
            ballast.write(bytes(shutil.disk_usage(delivery).free - 200_000))
        (delivery / "DELIVERED").touch()
        failed = until(
            lambda: (
                run
                if (run := running.runs().get(expected.name)) is not None and run.state == "Failed"
                else None
            ),
            200,
        )
        assert failed is not None
        assert "no space left" in failed.message
        assert not failed.has_ended
        os.truncate(delivery / ".ballast" / "file", 0)
        subprocess.run(["mount", "-o", "remount,size=200m", str(delivery)], check=True)
        recovering = time.monotonic()
        runs = running.all_ended([expected.name], 400)
        assert runs[expected.name].attempts == 2, "the same run, started again"
        figures["disk full"] = {
            "outcome": runs[expected.name].state,
            "attempts": [runs[expected.name].attempts],
            "ended_after_recovery_s": seconds_since(recovering),
            "wall_s": seconds_since(started),
        }
        _hold(running, [expected], runs)


def test_a_killed_supervisor(running: Production, figures: dict[str, dict[str, object]]) -> None:
    """The last one: the server is another one afterwards."""
    database = running.postgresql.url().replace(f":{os.environ['PGPASSWORD']}@", "@")
    again = {}

    def kill(running: Production, _run: RunRecord) -> None:
        groups = running.server.groups()
        running.server.process.kill()
        running.server.process.wait()
        until(lambda: not any(_alive(group) for group in groups), 300)
        again["server"] = served(running.folder, "--database", database, "--watch", "5")
        running.server = again["server"].__enter__()

    try:
        _outlasted(running, figures, "aerocal serve killed", kill)
    finally:
        if "server" in again:
            again["server"].__exit__(None, None, None)


def _alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
