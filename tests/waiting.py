"""Waiting for what another process does in its own time."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def until(
    what: Callable[[], T],
    seconds: float,
    process: subprocess.Popen[bytes] | None = None,
    pause_s: float = 0.2,
) -> T:
    """The first value of something that is true; fails when the time is over or the process has ended."""
    end = time.monotonic() + seconds
    while not (value := what()):
        assert time.monotonic() < end, f"not within {seconds} s"
        assert process is None or process.poll() is None, "the server has ended"
        time.sleep(pause_s)
    return value
