"""Children of ``aerocal serve``: their logs, and their restarts."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

import pytest

from flows.server import child
from flows.server.child import Child, Lifeline, Supervised
from tests.waiting import until

_TALKER = """
import time

def main():
    while True:
        print("x" * 99, flush=True)
        time.sleep(0.005)
"""


def test_a_log_that_has_grown_large_is_begun_anew_while_the_child_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "talker.py").write_text(_TALKER)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    monkeypatch.setattr(child, "_LOG_BYTES", 10_000)
    log = tmp_path / "logs" / "talker.log"
    lifeline = Lifeline()
    talker = Child("talker", environment=environment, log=log, lifeline=lifeline)
    try:
        while log.stat().st_size <= 10_000:
            assert not talker.ended
        talker.begin_log_anew()
        old = log.with_suffix(".old.log").read_text()
        assert len(old) > 10_000
        while log.stat().st_size < 1_000:
            assert not talker.ended
        # It goes on at the beginning: no hole where the old lines were.
        assert set(log.read_text()) == {"x", "\n"}
    finally:
        talker.end_group(5.0)
        lifeline.release()


def test_a_child_that_cannot_be_started_again_at_once_is_started_later(tmp_path: Path) -> None:
    (tmp_path / "ender.py").write_text("def main():\n    pass\n")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    lifeline = Lifeline()
    troubles = iter([None, OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)), None])

    def start() -> Child:
        trouble = next(troubles)
        if trouble is not None:
            raise trouble
        return Child("ender", environment=environment, log=tmp_path / "log", lifeline=lifeline)

    said: list[str] = []
    supervised = Supervised("runner", start, said.append)
    first = supervised.child
    assert first.wait(20.0)

    def is_another() -> bool:
        supervised.look()
        return supervised.child is not first

    until(is_another, 20.0)
    assert said == [
        "The runner has stopped unexpectedly; it is restarted in 1 s.",
        "The runner cannot be started (Cannot allocate memory); it is restarted in 2 s.",
    ]
    supervised.end()
    lifeline.release()
