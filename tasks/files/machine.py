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
    with suppress(OSError):
        numbers = Path("/proc/self/ns/pid").stat().st_ino
        # A container that is started again is another one: a system that was not restarted names its own.
        of_system = "/etc/machine-id" if numbers == _OF_SYSTEM else "/proc/sys/kernel/random/boot_id"
        return f"{name}-{zlib.crc32(f'{numbers} {Path(of_system).read_text()}'.encode()):08x}"
    return name
