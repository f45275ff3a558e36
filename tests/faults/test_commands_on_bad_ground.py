"""Commands that are killed, and folders that fill up, refuse to be written, move away, or have no time."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tasks.registry.calibration_file import SealedRecord
from tasks.registry.registry import Registry
from tasks.settings.load_simulation import load_simulation
from tasks.settings.registry import registry_address
from tasks.simulation.simulate import simulate_project
from tests.faults.projects import damage, published
from tests.flows.conftest import write_block
from tests.tasks.registry.records import changed, record

pytestmark = [pytest.mark.fault, pytest.mark.timeout(1800)]

#: Kills of each command that hit it while it runs, and tries that they may take.
HITS, TRIALS = 20, 60


def aerocal(*words: str | Path, **variables: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "flows.command", *map(str, words)]
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**os.environ, **variables}
    )


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and what was said."""
    _, said = process.communicate(timeout=300)
    return process.returncode, said


def said_in_one_sentence(said: str) -> bool:
    error = said[said.rindex("Error: ") :] if "Error: " in said else ""
    return bool(error) and len(error) < 24 * 80 and "Traceback" not in said


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Project file of a small calibration flight."""
    simulation = load_simulation("uce-calibration", ("points.count=400", "points.detection=0.5"))
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


@pytest.mark.parametrize("command", ["run", "calibrate"])
def test_killed_commands_never_spoil_a_later_one(command: str, flight: Path, tmp_path: Path) -> None:
    code, said = ended(aerocal(command, flight, "--out", tmp_path / "undisturbed"))
    assert code in (0, 4), said
    began = time.monotonic()
    ended(aerocal(command, flight, "--out", tmp_path / "again"))
    whole = time.monotonic() - began
    expected = published(tmp_path / "again")
    moments, hits = random.Random(11), 0
    out = tmp_path / "killed"
    for _ in range(TRIALS):
        process = aerocal(command, flight, "--out", out)
        time.sleep(moments.uniform(0.2, 0.9) * whole)
        process.send_signal(signal.SIGKILL)
        hit = ended(process)[0] == -signal.SIGKILL
        hits += hit
        assert not damage(out)
        # What is finished is taken up; after some kills, or one that came too late, all begins anew.
        if not hit or hits % 4 == 0:
            shutil.rmtree(out, ignore_errors=True)
        if hits == HITS:
            break
    assert ended(aerocal(command, flight, "--out", out))[0] == code
    assert published(out) == expected
    assert not list((out / ".store").glob("*/.*"))
    assert hits == HITS


def test_killed_additions_leave_the_registry_whole(tmp_path: Path) -> None:
    place, moments, hits = tmp_path / "registry.sqlite", random.Random(3), 0
    file = tmp_path / "calibration.json"
    file.write_text(SealedRecord.of(record()).content, encoding="utf-8")
    began = time.monotonic()
    words = ("registry", "add", file, "--registry", place, "--by", "ann", "--code", record().digest)
    code, said = ended(aerocal(*words))
    assert code == 0, said
    whole = time.monotonic() - began
    for number in range(1, TRIALS + 1):
        calibration = record(changed(number))
        file.write_text(SealedRecord.of(calibration).content, encoding="utf-8")
        process = aerocal(*words[:-1], calibration.digest)
        began = time.monotonic()
        time.sleep(moments.uniform(0.5, 1.0) * whole)
        process.send_signal(signal.SIGKILL)
        if ended(process)[0] == -signal.SIGKILL:
            hits += 1
        else:
            # The first one made the registry, or the machine was busier then.
            whole = min(whole, 0.9 * (time.monotonic() - began))
        found = Registry.at(registry_address(str(place))).verified()
        assert not found.findings
        if hits == HITS:
            break
    assert record().digest in digests(place)
    assert hits == HITS
    assert ended(aerocal(*words[:-1], calibration.digest))[0] in (0, 2)
    assert calibration.digest in digests(place)


def digests(registry: Path) -> set[str]:
    """Digests of the calibrations in a registry."""
    contents = Registry.at(registry_address(str(registry))).contents()
    return {stored.sealed.digest for stored in contents.calibrations}


@contextmanager
def disk(place: Path, size: str) -> Iterator[Path]:
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Project file of the synthetic block, and what a run of it publishes."""
    project = write_block(tmp_path_factory.mktemp("block"))
    code, said = ended(aerocal("run", project, "--out", project.parent / "sound"))
    assert code == 0, said
    return project, published(project.parent / "sound")


@pytest.mark.parametrize("size", ["16k", "64k", "256k", "400k"])
def test_a_disk_that_fills_up(block: tuple[Path, dict[str, str]], tmp_path: Path, size: str) -> None:
    project, expected = block
    with disk(tmp_path / "disk", size) as place:
        code, said = ended(aerocal("run", project, "--out", place / "results"))
        assert (code, said_in_one_sentence(said)) == (1, True), said
        assert "no space left" in said.lower()
        assert not damage(place / "results")
        subprocess.run(["mount", "-o", "remount,size=100m", str(place)], check=True)
        assert ended(aerocal("run", project, "--out", place / "results"))[0] == 0
        assert published(place / "results") == expected


def test_a_disk_that_may_only_be_read(block: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    project, expected = block
    with disk(tmp_path / "disk", "100m") as place:
        subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
        code, said = ended(aerocal("run", project, "--out", place / "results"))
        assert code in (1, 2)
        assert said_in_one_sentence(said), said
        subprocess.run(["mount", "-o", "remount,rw", str(place)], check=True)
        process = aerocal("run", project, "--out", place / "results")
        while not (place / "results" / ".store" / "import_exposures").exists() and process.poll() is None:
            time.sleep(0.05)
        # A file that is open for writing holds the disk as it is.
        while subprocess.run(["mount", "-o", "remount,ro", str(place)], stderr=subprocess.DEVNULL).returncode:
            time.sleep(0.01)
        code, said = ended(process)
        subprocess.run(["mount", "-o", "remount,rw", str(place)], check=True)
        assert code == 0 or (code == 1 and said_in_one_sentence(said)), said
        assert not damage(place / "results")
        assert ended(aerocal("run", project, "--out", place / "results"))[0] == 0
        assert published(place / "results") == expected


def test_a_folder_that_moves_away_during_a_run(block: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    project, expected = block
    out, elsewhere = tmp_path / "results", tmp_path / "elsewhere"
    process = aerocal("run", project, "--out", out)
    while not (out / ".store" / "import_exposures").exists() and process.poll() is None:
        time.sleep(0.05)
    out.rename(elsewhere)
    code, said = ended(process)
    assert code in (1, 2)
    assert said_in_one_sentence(said), said
    assert not damage(elsewhere)
    assert not published(out)
    assert ended(aerocal("run", project, "--out", elsewhere))[0] == 0
    assert published(elsewhere) == expected


@pytest.mark.parametrize("clock", ["@1969-07-20 20:17:40", "@2106-02-08 00:00:00", "-10y"])
def test_a_clock_that_is_wrong(block: tuple[Path, dict[str, str]], tmp_path: Path, clock: str) -> None:
    project, expected = block
    library = str(next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1")))
    faked = {"LD_PRELOAD": library, "FAKETIME": clock, "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
    code, said = ended(aerocal("run", project, "--out", tmp_path / "results", **faked))
    if code == 0:
        assert published(tmp_path / "results") == expected
    else:
        assert code == 1
        assert said_in_one_sentence(said), said
    assert ended(aerocal("run", project, "--out", tmp_path / "results"))[0] == 0
    assert published(tmp_path / "results") == expected
    json.loads((tmp_path / "results" / "manifest.json").read_text())
