"""The process of a run that has ended does not wait for ever for a server that does not answer."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from flows.server.settings import SETTINGS_VARIABLE
from flows.serving.last_reports import reported_for_a_while
from tests.conftest import Start

#: Ends its work, and then waits for ever, as a program does whose requests nobody answers.
_RUN = """
import threading
from flows.serving.last_reports import reported_for_a_while
with reported_for_a_while({seconds}):
    pass
print("done", flush=True)
threading.Event().wait({rest})
"""


class _Well(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.fixture
def server() -> Iterator[HTTPServer]:
    with HTTPServer(("127.0.0.1", 0), _Well) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def ended_run(start: Start, server: HTTPServer, seconds: float, rest: str = "") -> subprocess.Popen[str]:
    """The process of a run that has ended, whose server is this one."""
    variables = {
        **os.environ,
        "PREFECT__FLOW_RUN_ID": "of-the-run",
        SETTINGS_VARIABLE: "of-the-runner",
        "PREFECT_API_URL": f"http://127.0.0.1:{server.server_port}/api",
    }
    program = _RUN.format(seconds=seconds, rest=rest)
    process = start(
        sys.executable, "-c", program, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "done\n"
    return process


def test_it_waits_as_long_as_the_server_answers_and_not_for_ever_when_it_does_not(
    start: Start, server: HTTPServer
) -> None:
    waiting = ended_run(start, server, 3.0)
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.wait(8.0)
    server.shutdown()
    server.server_close()
    _, said = waiting.communicate(timeout=30.0)
    assert waiting.returncode == 0, "the runner would report it as crashed"
    assert said == (
        f"the server http://127.0.0.1:{server.server_port}/api has not answered for 3 s; it hears of the end "
        "of this run from the record of runs, and the process of the run ends\n"
    )


def test_one_that_has_told_everything_ends_at_once(start: Start, server: HTTPServer) -> None:
    assert ended_run(start, server, 60.0, "0").wait(20.0) == 0


@pytest.mark.parametrize("variable", ["PREFECT__FLOW_RUN_ID", SETTINGS_VARIABLE])
def test_other_processes_are_left_alone(monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    for name in ("PREFECT__FLOW_RUN_ID", SETTINGS_VARIABLE):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, "of-a-command-or-a-worker")
    before = threading.active_count()
    with reported_for_a_while(0.0):
        pass
    assert threading.active_count() == before


def test_it_ends_before_prefect_would_report_a_failure() -> None:
    from prefect.settings import get_current_settings

    from flows.serving.deployed import REPORTING_S

    settings = get_current_settings().client
    pauses = (2.0**number for number in range(1, settings.max_retries + 1))
    assert 10.0 < REPORTING_S < (1.0 - settings.retry_jitter_factor) * sum(pauses)
