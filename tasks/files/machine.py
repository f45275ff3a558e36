"""Which machine numbers this process: a number of a process says nothing about one of another machine.

Containers are machines of their own in this respect, and several may have one host name.
"""

from __future__ import annotations

import socket
import zlib
from contextlib import suppress
from pathlib import Path

#: The processes of a system outside of containers (PROC_PID_INIT_INO of Linux).
_OF_SYSTEM = 0xEFFFFFFC


def machine() -> str:
    """Name of the machine, which no other machine or container has; the same after a restart of a machine."""
    name = socket.gethostname()
    with suppress(OSError, IndexError):
        numbers = Path("/proc/self/ns/pid").stat().st_ino
        if numbers == _OF_SYSTEM:
            which = Path("/etc/machine-id").read_text()
        else:
            # A container that is started again is another one, even if it is numbered as one that has ended.
            which = Path("/proc/sys/kernel/random/boot_id").read_text() + _beginning_of_first_process()
        return f"{name}-{zlib.crc32(f'{numbers} {which}'.encode()):08x}"
    return name


def _beginning_of_first_process() -> str:
    """Clock ticks from the start of the system to that of process 1 here (field 22 of proc_pid_stat)."""
    after_its_name = Path("/proc/1/stat").read_text().rpartition(")")[2]
    return after_its_name.split()[19]
