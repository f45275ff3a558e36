"""The machine a benchmark ran on, in neutral words, and the memory a process has used."""

from __future__ import annotations

import os
import platform
import resource
import sys
from importlib.metadata import version
from pathlib import Path

from adjust.options import available_threads

REPOSITORY = Path(__file__).resolve().parents[1]
# Of this process on Linux; the other way to ask also counts that of its parent.
_STATUS = Path("/proc/self/status")


def peak_memory_mib() -> float:
    """Largest resident memory this process has had, MiB, and not the one that started it."""
    if _STATUS.exists():
        line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) / 1024.0
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest / (1024.0 * 1024.0 if sys.platform == "darwin" else 1024.0)


def machine() -> str:
    """Cores, architecture, memory and versions; nothing that names the machine."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return (
        f"{available_threads()} cores, {platform.machine()}, {memory:.0f} GiB; "
        f"{platform.python_implementation()} {platform.python_version()}, {versions}"
    )
