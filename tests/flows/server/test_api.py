"""Calls to the server: with the password, again when its database is busy, else one clear sentence."""

from __future__ import annotations

import base64
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import ClassVar

import pytest

from flows.server import api as calls
from flows.server.api import Api
from flows.server.prefect_settings import UnknownCallerError, require_server
from flows.server.server_process import CLIENT_PASSWORD
from tasks.files.installation import InstallationError
from tasks.patience import Patience


class Answers(HTTPServer):
    """A server that answers with what it is told, one after the other, and keeps what it was asked."""

    codes: ClassVar[list[int]] = []
    asked: ClassVar[list[tuple[str, str | None]]] = []


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        Answers.asked.append((self.path, self.headers.get("Authorization")))
        code = Answers.codes.pop(0) if Answers.codes else 200
        self.send_response(code)
        self.end_headers()
        self.wfile.write(b'{"said": 1}')

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.do_GET()

    def log_message(self, *_arguments: object) -> None:
        """Quiet."""


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setattr(calls, "_PATIENCE", Patience(0.02, 0.05, 0.6))
    Answers.codes.clear()
    Answers.asked.clear()
    with Answers(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/api"
        server.shutdown()
        thread.join()


def test_a_busy_server_is_asked_again_and_not_for_ever(address: str) -> None:
    Answers.codes[:] = [503, 503, 200]
    assert Api(address).post("/flow_runs/filter", {}) == {"said": 1}
    assert len(Answers.asked) == 3
    Answers.codes[:] = [503] * 1000
    with pytest.raises(InstallationError, match=r"refused /flow_runs/filter \(503\)"):
        Api(address).post("/flow_runs/filter", {})
    asked = len(Answers.asked)
    assert asked > 4
    Answers.codes[:] = [401]
    with pytest.raises(InstallationError, match=r"\(401\)"):
        Api(address).get("/version")
    assert len(Answers.asked) == asked + 1


def test_the_password_goes_with_every_call(address: str) -> None:
    Api(address, "ann:password").get("/x")
    assert Answers.asked == [("/api/x", f"Basic {base64.b64encode(b'ann:password').decode()}")]


def test_a_server_that_asks_for_a_password_is_told_from_one_that_does_not_answer(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CLIENT_PASSWORD, "ann:password")
    require_server(address)
    assert Answers.asked[1] == ("/api/version", f"Basic {base64.b64encode(b'ann:password').decode()}")
    Answers.codes[:] = [200, 401]
    with pytest.raises(UnknownCallerError, match=f"set {CLIENT_PASSWORD}=user:password") as refused:
        require_server(address)
    assert "ann:password" not in str(refused.value)
    Answers.codes[:] = [200, 500]
    with pytest.raises(InstallationError, match="does not answer like a Prefect server"):
        require_server(address)
