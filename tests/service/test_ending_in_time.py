"""`aerocal serve` answers SIGTERM within 10 s, whatever a watch, a runner or a browser is doing."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests.flows.conftest import write_block
from tests.service.served import Served, engines_of, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"
_AT_MOST_S = 10.0
_GB = 10**9


def deliver_listed(inbox: Path, name: str, size: int) -> None:
    """A delivery whose marker lists a file with a hole of this size, bytes, under a digest it has not."""
    folder = inbox / name
    write_block(folder)
    with (folder / "more.bin").open("wb") as stream:
        stream.truncate(size)
    (folder / "DELIVERED").write_text(f"{'0' * 64}  more.bin\n")


def is_open(folder: Path, name: str) -> bool:
    """Whether any process reads a file of this name below a folder."""
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            file = link.readlink()
            if file.name == name and file.is_relative_to(folder):
                return True
    return False


def seconds_to_end(server: Served) -> float:
    """From the request until it has ended."""
    began = time.monotonic()
    server.process.send_signal(signal.SIGTERM)
    server.process.wait(60)
    return time.monotonic() - began


def test_while_the_watch_digests_huge_deliveries_and_a_form_is_open(tmp_path: Path, browser: Browser) -> None:
    write_block(tmp_path / "root" / "block")
    with served(tmp_path) as server:
        context = browser.new_context()
        page = context.new_page()
        server.let_in(page)
        found = server.api.get(f"/deployments/name/{MANUAL}")
        page.goto(f"http://127.0.0.1:{server.port}/deployments/deployment/{found['id']}/run")
        page.get_by_text("project", exact=False).first.wait_for(timeout=60_000)
        for number in range(3):
            deliver_listed(tmp_path / "inbox", f"large-{number}", 4 * _GB)
        deliver_listed(tmp_path / "inbox", "endless", 300 * _GB)
        until(lambda: is_open(tmp_path / "inbox", "more.bin"), 90)
        assert seconds_to_end(server) < _AT_MOST_S
        assert server.process.returncode == 0
        context.close()


def test_while_a_run_reads_a_huge_delivery(tmp_path: Path) -> None:
    project = write_block(tmp_path / "root" / "huge")
    points = project.parent / "image_points.csv"
    # Rows enough that reading them takes longer than the test: names are long, and all are different.
    rows = "".join(f"1_001,#{'q' * 100}{number},1.5,1.5\n" for number in range(100_000))
    with points.open("a") as stream:
        for part in range(80):
            stream.write(rows.replace("#", f"{part}-"))
    with served(tmp_path) as server:
        run = server.start(MANUAL, {"project": "huge"})
        until(lambda: server.run(run)["state_type"] == "RUNNING", 120)
        runner = server.group_of("flows.serving.deployments")
        until(lambda: is_open(tmp_path / "root", "image_points.csv"), 120)
        began = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        until(lambda: "a second request stops them now" in server.printed, _AT_MOST_S)
        assert server.process.poll() is None, "what has started is finished"
        assert time.monotonic() - began < _AT_MOST_S
        assert seconds_to_end(server) < _AT_MOST_S
        assert not engines_of(runner)
