"""Logs of the children of ``aerocal serve``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from flows.server import child
from flows.server.child import Child, Lifeline

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
