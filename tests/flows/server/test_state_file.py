"""The state file: found while its writer lives, never believed afterwards."""

from __future__ import annotations

import fcntl
import os
import stat
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from flows.server.prefect_settings import server_to_report_to
from flows.server.state_file import (
    RunningServer,
    find_server,
    has_moved,
    keep_link,
    make_private,
    the_only_server,
    write_state,
)
from tasks.files.installation import InstallationError
from tasks.production.records import Records

SERVER = RunningServer("http://127.0.0.1:9/api", os.getpid())


def test_a_server_is_found_while_it_lives_and_gone_afterwards(tmp_path: Path) -> None:
    assert find_server(tmp_path) is None
    with the_only_server(tmp_path):
        write_state(tmp_path, SERVER)
        assert find_server(tmp_path) == SERVER
    assert find_server(tmp_path) is None


@pytest.mark.parametrize("change", [{"url": "http://127.0.0.1:10/api"}, {"records": "postgresql://other"}])
def test_a_server_has_moved_once_it_lives_elsewhere(tmp_path: Path, change: dict[str, str]) -> None:
    with the_only_server(tmp_path):
        write_state(tmp_path, SERVER)
        write_state(tmp_path, replace(SERVER, pid=1))
        assert not has_moved(SERVER, tmp_path)
        write_state(tmp_path, replace(SERVER, **change))  # type: ignore[arg-type]
        assert has_moved(SERVER, tmp_path)
        assert not has_moved(None, tmp_path)
    write_state(tmp_path, replace(SERVER, **change))  # type: ignore[arg-type]
    assert not has_moved(SERVER, tmp_path), "it has ended"


def test_the_state_file_is_private(tmp_path: Path) -> None:
    with the_only_server(tmp_path / "new"):
        write_state(tmp_path / "new", SERVER)
        for path, mode in ((tmp_path / "new", 0o700), (tmp_path / "new" / "serve.json", 0o600)):
            assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_folder_that_cannot_be_written_is_said_with_the_option_for_another(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InstallationError, match="--state"):
        make_private(tmp_path / "file" / "state")
    (tmp_path / "link.new").mkdir()
    with pytest.raises(InstallationError, match="--state"):
        keep_link(tmp_path, "http://127.0.0.1:4200/enter#key")
    with pytest.raises(InstallationError, match="--database"):
        Records.at(str(tmp_path / "file" / "records.sqlite")).prepare()


def test_a_second_server_is_refused_and_harms_nothing(tmp_path: Path) -> None:
    with the_only_server(tmp_path):
        write_state(tmp_path, SERVER)
        with pytest.raises(InstallationError, match=f"process {SERVER.pid}"), the_only_server(tmp_path):
            pytest.fail("two servers in one folder")
        assert find_server(tmp_path) == SERVER


def killed_server(folder: Path) -> RunningServer:
    """Leaves the state file of a process that was killed while another program has its number."""
    program = (
        "import os, signal; from pathlib import Path\n"
        "from flows.server.state_file import RunningServer, the_only_server, write_state\n"
        f"with the_only_server(Path({str(folder)!r})):\n"
        f"    write_state(Path({str(folder)!r}), RunningServer({SERVER.url!r}, {os.getpid()}))\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == -9
    return SERVER


def test_a_command_that_looks_for_the_server_does_not_keep_it_from_starting(tmp_path: Path) -> None:
    look = os.open(tmp_path / "serve.lock", os.O_RDWR | os.O_CREAT)
    fcntl.flock(look, fcntl.LOCK_SH)
    timer = threading.Timer(0.1, os.close, [look])
    timer.start()
    with the_only_server(tmp_path):
        write_state(tmp_path, SERVER)
        assert find_server(tmp_path) == SERVER
    timer.join()


def test_a_killed_server_is_known_to_be_dead_though_its_number_lives(tmp_path: Path) -> None:
    killed_server(tmp_path)
    assert find_server(tmp_path) == replace(SERVER, alive=False)
    with the_only_server(tmp_path):
        pass
    assert find_server(tmp_path) is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"url": "x"}', '{"url": "x", "pid": "many"}'])
def test_a_damaged_state_file_counts_as_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "serve.json").write_text(text)
    assert find_server(tmp_path) is None


def test_a_run_remarks_on_a_dead_server_and_stays_in_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path))
    killed_server(tmp_path)
    remarks: list[str] = []
    assert server_to_report_to(None, remarks.append) is None
    assert [remark for remark in remarks if "no longer running" in remark]
    assert server_to_report_to("none", pytest.fail) is None


def test_a_living_server_that_does_not_answer_is_a_remark_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path))
    remarks: list[str] = []
    with the_only_server(tmp_path):
        write_state(tmp_path, SERVER)
        assert server_to_report_to(None, remarks.append) is None
    assert [remark for remark in remarks if "does not answer" in remark]


def test_a_server_that_was_asked_for_must_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path))
    with pytest.raises(InstallationError, match="does not answer"):
        server_to_report_to(SERVER.url, pytest.fail)
