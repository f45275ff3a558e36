"""One run at a time in an output folder."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.store.run_lock import require_in_place, run_lock
from tests.conftest import Start

_HOLDER = """
import sys, time
from pathlib import Path
from tasks.errors import InputError
from tasks.store.run_lock import require_in_place, run_lock
with run_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


def hold(start: Start, directory: Path, seconds: float) -> subprocess.Popen[str]:
    holder = start(sys.executable, "-c", _HOLDER, directory, str(seconds), stdout=subprocess.PIPE)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    return holder


def test_a_second_run_says_whom_it_waits_for_and_then_runs(
    start: Start, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    holder = hold(start, tmp_path, 1.5)
    started = time.monotonic()
    with run_lock(tmp_path):
        waited = time.monotonic() - started
    assert waited > 0.5
    assert f"another run (process {holder.pid}) is writing into {tmp_path}" in caplog.text


def test_the_lock_of_a_killed_run_is_free_at_once(
    start: Start, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    holder = hold(start, tmp_path, 60)
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


def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    valuable = tmp_path / "valuable"
    valuable.write_text("must stay")
    (tmp_path / "results" / ".store").mkdir(parents=True)
    (tmp_path / "results" / ".store" / "lock").symlink_to(valuable)
    with pytest.raises(InstallationError, match="lock cannot be written"), run_lock(tmp_path / "results"):
        pass
    assert valuable.read_text() == "must stay"


@pytest.mark.parametrize("place", ["stage", "stage/key", "stage/key/table.parquet", "records"])
def test_links_among_finished_stages_are_refused(tmp_path: Path, place: str) -> None:
    link = tmp_path / "results" / ".store" / place
    link.parent.mkdir(parents=True)
    (tmp_path / "outside").mkdir()
    link.symlink_to(tmp_path / "outside")
    with pytest.raises(InputError, match="a link in the folder") as refused, run_lock(tmp_path / "results"):
        pass
    assert refused.value.file == link
    assert list((tmp_path / "outside").iterdir()) == []


def test_a_confined_run_gets_no_lock_outside(tmp_path: Path) -> None:
    root, outside = tmp_path / "root", tmp_path / "outside"
    root.mkdir()
    (outside / ".store").mkdir(parents=True)
    (outside / ".store" / "lock").write_text("must stay")
    with run_lock(root / "sound", (root,)):
        pass
    (root / "results").symlink_to(outside)
    with pytest.raises(InputError, match="leads out"), run_lock(root / "results", (root,)):
        pass
    assert (outside / ".store" / "lock").read_text() == "must stay"
    # Somebody who runs it by hand may keep results wherever a link leads.
    with run_lock(root / "results"):
        pass


def test_a_folder_that_was_replaced_after_it_had_been_locked_is_noticed(tmp_path: Path) -> None:
    results = tmp_path / "results"
    require_in_place(results)
    with run_lock(results):
        require_in_place(results)
        results.rename(tmp_path / "aside")
        with pytest.raises(InstallationError, match="moved or replaced"):
            require_in_place(results)
        (tmp_path / "other" / ".store").mkdir(parents=True)
        (tmp_path / "other" / ".store" / "lock").touch()
        results.symlink_to(tmp_path / "other")
        with pytest.raises(InstallationError, match="moved or replaced"):
            require_in_place(results)
        results.unlink()
        (tmp_path / "aside").rename(results)
        require_in_place(results)
