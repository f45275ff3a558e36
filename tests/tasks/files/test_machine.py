"""Machines and containers of one host name are told apart."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tasks.files.installation import remove_abandoned
from tasks.files.machine import machine

#: A process with numbers of its own, as in a container, and under the host name of this machine.
CONTAINER = ("unshare", "--user", "--map-root-user", "--pid", "--fork", "--mount-proc")


def in_container(program: str, *words: str) -> str:
    if subprocess.run((*CONTAINER, "true"), capture_output=True, check=False).returncode:
        pytest.skip("this system lets nobody make a container")
    command = (*CONTAINER, sys.executable, "-c", program, *words)
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_the_name_is_that_of_every_process_of_a_machine() -> None:
    told = subprocess.run(
        [sys.executable, "-c", "from tasks.files.machine import machine; print(machine())"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout.strip() == machine()


def test_two_containers_of_one_host_name_are_two_machines() -> None:
    program = "import socket; from tasks.files.machine import machine; print(socket.gethostname(), machine())"
    (host, first), (again, second) = (in_container(program).split() for _ in range(2))
    assert host == again
    assert len({first, second, machine()}) == 3


def test_what_a_container_of_the_same_host_name_is_writing_is_not_removed(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from tasks.files.installation import part_of;"
        "part = part_of(Path(sys.argv[1])); part.write_text('half'); print(part.name)"
    )
    name = in_container(program, str(tmp_path / "a.csv"))
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    # It may have any number there, also that of a process that has ended here.
    theirs = (tmp_path / name).rename(tmp_path / name.replace(".1.", f".{ended.pid}."))
    assert theirs.name != name
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == [theirs]
