"""The interrupt key and SIGTERM end a command within 10 s, whatever it is doing, and leave nothing behind."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from pathlib import Path

import psutil
import pytest

from flows.command import interruption
from tasks.store.run_lock import run_lock
from tests.command_line import aerocal
from tests.conftest import Start
from tests.grids import diagonal_daily

#: What the contract promises, s.
LIMIT_S = 10.0
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}

#: The signal is taken by another thread while the main thread stands in a system call without end.
BLOCKED = """
def command():
    held = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
    fcntl.flock(held, fcntl.LOCK_EX)
    def take():
        time.sleep(0.3)
        signal.pthread_kill(threading.get_ident(), number)
    threading.Thread(target=take, daemon=True).start()
    fcntl.flock(os.open(sys.argv[1], os.O_RDWR), fcntl.LOCK_EX)
"""

#: The exception is raised where Python drops exceptions, and the command goes on.
DROPPED = """
class Dropping:
    def __del__(self):
        os.kill(os.getpid(), number)
        time.sleep(0.0)
def command():
    Dropping()
    while True:
        time.sleep(1.0)
"""

#: What has to be left first does not end.
CLEANING = """
def command():
    try:
        os.kill(os.getpid(), number)
        time.sleep(1.0)
    finally:
        threading.Event().wait()
"""

#: The command comes to its own end, good or bad, although it was asked to stop.
SWALLOWED = """
def command():
    try:
        os.kill(os.getpid(), number)
        time.sleep(1.0)
    except BaseException:
        sys.exit(4)
"""

#: A library makes another exception of it.
REPLACED = """
def command():
    try:
        os.kill(os.getpid(), number)
        time.sleep(1.0)
    except BaseException as error:
        raise ValueError("something else") from error
"""

#: The signal comes when the command has ended and the interpreter waits for threads.
ENDED = """
def command():
    def last():
        time.sleep(0.5)
        os.kill(os.getpid(), number)
        time.sleep(60)
    threading.Thread(target=last).start()
    print("shown")
"""


ENDS = [
    *((program, sent) for program in (BLOCKED, SWALLOWED, REPLACED, ENDED) for sent in CODES),
    (DROPPED, signal.SIGINT),
    (CLEANING, signal.SIGTERM),
]


def test_nothing_keeps_a_command_from_ending(start: Start, tmp_path: Path) -> None:
    imports = (
        "import fcntl, os, signal, sys, threading, time\nfrom flows.command import interruption\n"
        "from flows.command.interruption import *\n"
    )
    # What cleaning up may take is within what the contract promises; the last two take it all.
    assert interruption._GRACE_S < LIMIT_S - 1.0
    imports += "interruption._GRACE_S = 3.0\n"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    processes = [
        start(
            *(sys.executable, "-c", f"{imports}number = {int(sent)}\n{program}\nend_on_signals(command)"),
            tmp_path / f"lock-{number}",
            **pipes,
        )
        for number, (program, sent) in enumerate(ENDS)
    ]
    for process, (program, sent) in zip(processes, ENDS, strict=True):
        shown, complained = process.communicate(timeout=60)
        assert process.returncode in (CODES[sent], -sent), program
        assert (process.returncode < 0) == (program is ENDED), program
        assert shown == ("shown\n" if program is ENDED else ""), program
        assert ("without cleaning up" in complained) == (program in (DROPPED, CLEANING)), program
        assert ("Traceback" in complained) == (program is DROPPED), program


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the device that is always full")
@pytest.mark.parametrize(
    ("words", "unbuffered"), diagonal_daily([("--version",), ("export",), ("run", "--help")], ["1", ""])
)
def test_no_space_for_what_is_printed_is_one_sentence(words: tuple[str, ...], unbuffered: str) -> None:
    command = [sys.executable, "-m", "flows.command", *words]
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, env=environment, check=False)
    assert done.returncode == 1
    said = done.stderr.decode()
    assert said.startswith("Error: What was printed could not be written (No space left on device).")
    assert len(said.splitlines()) == 1, said


def test_output_that_nobody_reads_to_its_end_is_no_failure() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    environment = os.environ | {"PYTHONUNBUFFERED": ""}
    command = [sys.executable, "-m", "flows.command", "export"]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, env=environment, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) in ((0, b""), (1, b""))


def test_a_command_in_the_background_of_a_shell_ignores_the_interrupt_key(start: Start) -> None:
    program = (
        "import os, signal\nfrom flows.command.interruption import *\n"
        "def command(): os.kill(os.getpid(), signal.SIGINT); raise SystemExit(3)\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nend_on_signals(command)"
    )
    assert start(sys.executable, "-c", program).wait(60) == 3


def run(start: Start, block: Path, out: Path, *arguments: str, **options: object) -> subprocess.Popen[str]:
    command = (sys.executable, "-m", "flows.command", "run", block, "--out", out, *arguments)
    return start(*command, stdout=subprocess.DEVNULL, **options)


@pytest.mark.parametrize(
    ("server", "sent"),
    [
        ("none", signal.SIGTERM),
        pytest.param("", signal.SIGINT, marks=pytest.mark.prefect),
        pytest.param("none", signal.SIGINT, marks=pytest.mark.slow),
        pytest.param("", signal.SIGTERM, marks=[pytest.mark.prefect, pytest.mark.slow]),
    ],
)
def test_a_run_that_waits_for_another_one_can_be_stopped(
    start: Start,
    block: Path,
    tmp_path: Path,
    request: pytest.FixtureRequest,
    sent: signal.Signals,
    server: str,
) -> None:
    address = server or request.getfixturevalue("server_address")
    with run_lock(tmp_path / "out"):
        process = run(start, block, tmp_path / "out", "--server", address, stderr=subprocess.PIPE)
        assert process.stderr is not None
        assert any("another run" in line for line in process.stderr)
        process.send_signal(sent)
        complained = process.communicate(timeout=60)[1]
    assert process.returncode == CODES[sent]
    assert "will be reused" in complained
    assert "Traceback" not in complained


@pytest.fixture
def server_address(prefect_server: None) -> str:  # noqa: ARG001
    """Address of the server of the tests."""
    from prefect.settings import PREFECT_API_URL

    return str(PREFECT_API_URL.value())


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("waits", [True, False], ids=["waiting", "computing"])
@pytest.mark.parametrize("server", ["none", pytest.param("", marks=pytest.mark.prefect)])
def test_at_any_moment(
    start: Start, block: Path, tmp_path: Path, request: pytest.FixtureRequest, waits: bool, server: str
) -> None:
    address = server or request.getfixturevalue("server_address")
    started = time.monotonic()
    assert run(start, block, tmp_path / "whole", "--server", address).wait(300) == 0
    whole = time.monotonic() - started
    expected = digests(tmp_path / "whole")
    draw = random.Random(22)
    longest, tracebacks, codes = 0.0, 0, Counter[int]()
    for trial in range(50):
        sent = draw.choice(list(CODES))
        out = tmp_path / f"out-{trial}"
        with run_lock(out) if waits else nullcontext():
            with (tmp_path / f"complained-{trial}").open("w+") as stderr:
                process = run(start, block, out, "--server", address, stderr=stderr)
                time.sleep(draw.uniform(0.0, whole))
                left = process.poll() is None
                process.send_signal(sent)
                asked = time.monotonic()
                process.wait(60)
                longest = max(longest, time.monotonic() - asked)
                stderr.seek(0)
                complained = stderr.read()
            if left:
                # Before and after our own lines the signal itself ends it; a shell shows the same code.
                assert process.returncode in (CODES[sent], -sent), complained
                assert "without cleaning up" not in complained
                tracebacks += "Traceback" in complained
            codes[process.returncode] += 1
            assert not list(of_session(process.pid))
        assert aerocal("run", block, "--out", out, "--server", "none").returncode == 0
        assert digests(out) == expected
    print(f"\nlongest end {longest:.1f} s; a whole run {whole:.1f} s; tracebacks {tracebacks}; {codes}")
    assert longest < LIMIT_S
    # Most of them came while it was running.
    assert codes[0] < 20


def of_session(leader: int) -> Iterator[psutil.Process]:
    """Everything that is left of what a program has started."""
    for process in psutil.process_iter():
        with suppress(ProcessLookupError, psutil.NoSuchProcess):
            if os.getsid(process.pid) == leader and process.status() != psutil.STATUS_ZOMBIE:
                yield process


def digests(out: Path) -> dict[str, str]:
    """File name → digest of everything published."""
    artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}
