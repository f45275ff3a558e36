"""What the production page asks of the server: its whole queue, by names, and nothing of one that hangs."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from flows.overview.run_tables import queue_part
from flows.overview.sources import ServerView, server_view
from flows.server.api import Api

NOW = datetime(2026, 5, 4, 12, tzinfo=UTC)
DUE = 531


class Handler(BaseHTTPRequestHandler):
    """A server with runs due one a minute, and two searches of the inbox; it hands out as many as wanted."""

    def do_GET(self) -> None:
        self._answer(True)

    def do_POST(self) -> None:
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        runs = [
            {
                "id": f"{number}", "name": "lucky-boa", "state_type": "SCHEDULED", "state_name": "Late",
                "deployment_id": "1", "flow_id": "1", "parameters": {"project": f"/data/block.{number}"},
                "expected_start_time": (NOW - timedelta(minutes=DUE - number)).isoformat(),
            }
            for number in range(min(asked.get("limit", 0), DUE))
        ]  # fmt: skip
        nightly = {"flow_id": "2", "parameters": {"story": "aerial-triangulation"}}
        for place, hours in ((-2, 9), (-1, 33)) if runs else ():
            due = (NOW + timedelta(hours=hours)).isoformat()
            runs[place] = {**runs[place], **nightly, "expected_start_time": due}
        if self.path == "/api/flows/filter":
            self._answer([{"id": "1", "name": "system-calibration"}, {"id": "2", "name": "inbox"}])
        elif self.path == "/api/flow_runs/filter":
            self._answer(runs)
        else:
            assert asked["flow_runs"]["expected_start_time"]
            self._answer(DUE)

    def _answer(self, said: object) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(json.dumps(said).encode())

    def log_message(self, *_arguments: object) -> None:
        """Quiet."""


@pytest.fixture
def api() -> Iterator[Api]:
    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield Api(f"http://127.0.0.1:{server.server_port}/api")
        server.shutdown()
        thread.join()


def test_all_waiting_runs_are_counted(api: Api) -> None:
    view = server_view(api, NOW)
    assert (view.reachable, len(view.queue) + view.more) == (True, DUE)
    assert f"And {DUE - 25} more." in str(queue_part(view, None, NOW, ""))


def test_waiting_runs_are_called_by_project_and_story_as_those_that_have_begun(api: Api) -> None:
    assert [run.name for run in server_view(api, NOW).queue[:2]] == [
        "block.0 · system-calibration", "block.1 · system-calibration"
    ]  # fmt: skip


def test_the_next_search_of_the_inbox_is_known(api: Api) -> None:
    assert server_view(api, NOW).search == NOW + timedelta(hours=9)


def test_a_server_that_hangs_is_asked_for_a_sign_of_life_only() -> None:
    """It is waited for 5 s instead of 30, while everybody who looks at the page waits."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        view = server_view(Api(f"http://127.0.0.1:{silent.getsockname()[1]}/api"), NOW)
        silent.setblocking(False)
        with silent.accept()[0] as first:
            assert first.recv(1000).startswith(b"GET /api/health ")
        with pytest.raises(BlockingIOError):
            silent.accept()
    assert view == ServerView(False, (), None)
