"""One run at a time in an output folder."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tasks.storage.installation import InstallationError
from tasks.storage.run_lock import run_lock

_HOLDER = """
import sys, time
from pathlib import Path
from tasks.storage.run_lock import run_lock
with run_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


def hold(directory: Path, seconds: float) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", _HOLDER, str(directory), str(seconds)]
    holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    return holder


def test_a_second_run_says_whom_it_waits_for_and_then_runs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with hold(tmp_path, 1.5) as holder:
        started = time.monotonic()
        with run_lock(tmp_path):
            waited = time.monotonic() - started
        assert waited > 0.5
        assert f"another run (process {holder.pid}) is writing into {tmp_path}" in caplog.text


def test_the_lock_of_a_killed_run_is_free_at_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with hold(tmp_path, 60) as holder:
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        with run_lock(tmp_path):
            assert caplog.text == ""


def test_an_output_folder_that_is_a_file_is_one_clear_message(tmp_path: Path) -> None:
    (tmp_path / "results").write_text("not a folder")
    with (
        pytest.raises(InstallationError, match=r"results.* cannot be written"),
        run_lock(tmp_path / "results"),
    ):
        pass
