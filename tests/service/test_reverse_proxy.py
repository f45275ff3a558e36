"""deploy/nginx.conf: who has signed in reaches the production page, nobody else does."""

from __future__ import annotations

import base64
import http.client
import re
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest

from flows.overview.application import page_server
from flows.overview.sources import Sources
from flows.server.api import Api
from flows.server.door import door_of
from flows.server.roots import Roots
from tasks.production.records import Records
from tests.conftest import REPOSITORY
from tests.ports import free_port

pytestmark = pytest.mark.service
PASSWORD, HOST = "aerocal:long-random-text", "production.example.org"


class SignIn(BaseHTTPRequestHandler):
    """What oauth2-proxy answers: 202 to who has its cookie, 401 to others, and a page to sign in."""

    def do_GET(self) -> None:
        known = "signed-in=yes" in self.headers.get("Cookie", "")
        self.send_response(202 if known else 401 if self.path == "/oauth2/auth" else 200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def proxy(tmp_path: Path) -> Iterator[int]:
    """The port of nginx with the recipe, in front of a production page and a stand-in for oauth2-proxy."""
    nginx = shutil.which("nginx") or shutil.which("/usr/sbin/nginx")
    assert nginx is not None, "nginx is missing: make service-deps"
    (tmp_path / "root").mkdir()
    page, listening = free_port("127.0.0.1"), free_port("127.0.0.1")
    sign_in = ThreadingHTTPServer(("127.0.0.1", 0), SignIn)
    threading.Thread(target=sign_in.serve_forever, daemon=True).start()
    sources = Sources(
        Records.at(str(tmp_path / "records.sqlite")),
        "https://aerocal.example.org",
        Roots(((tmp_path / "root").resolve(),)),
        Api("http://127.0.0.1:9/api"),
        door_of(PASSWORD, [], ["https://aerocal.example.org", f"https://{HOST}"]),
        None,
        lambda: None,
        ZoneInfo("UTC"),
    )
    secret = tmp_path / "password"
    secret.write_text(
        f'proxy_set_header Authorization "Basic {base64.b64encode(PASSWORD.encode()).decode()}";\n'
    )
    recipe = (REPOSITORY / "deploy" / "nginx.conf").read_text(encoding="utf-8")
    # TLS ends elsewhere in this test; all else is as it stands.
    recipe = re.sub(r"^ *ssl_certificate.*\n", "", recipe, flags=re.MULTILINE)
    for old, new in (
        ("listen 443 ssl", f"listen 127.0.0.1:{listening}"),
        ("127.0.0.1:4201", f"127.0.0.1:{page}"),
        ("127.0.0.1:4180", f"127.0.0.1:{sign_in.server_port}"),
        ("/etc/nginx/aerocal-password", str(secret)),
    ):
        assert old in recipe
        recipe = recipe.replace(old, new)
    configuration = tmp_path / "nginx.conf"
    configuration.write_text(
        f"pid {tmp_path}/nginx.pid; error_log {tmp_path}/error.log; daemon off;\n"
        f"events {{}}\nhttp {{ access_log off; client_body_temp_path {tmp_path}/body;\n"
        f"proxy_temp_path {tmp_path}/proxy; fastcgi_temp_path {tmp_path}/f; uwsgi_temp_path {tmp_path}/u;\n"
        f"scgi_temp_path {tmp_path}/s;\n{recipe}\n}}\n"
    )
    with page_server(sources, "127.0.0.1", page):
        process = subprocess.Popen([nginx, "-c", str(configuration), "-p", str(tmp_path)])
        try:
            _wait_for(listening, process)
            yield listening
        finally:
            process.terminate()
            process.wait(20)
            sign_in.shutdown()
            sign_in.server_close()


def _wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    for _ in range(200):
        assert process.poll() is None, "nginx has ended"
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except OSError:
            time.sleep(0.1)
        else:
            return
    raise AssertionError("nginx does not listen")


def asked(port: int, path: str, **headers: str) -> tuple[int, str, bytes]:
    """Status, headers as text, and content of an answer."""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection:
        connection.request("GET", path, headers={"Host": HOST, **headers})
        answer = connection.getresponse()
        return answer.status, str(answer.headers), answer.read()


def test_who_has_not_signed_in_is_sent_there_and_sees_nothing(proxy: int) -> None:
    for path in ("/", "/metrics", "/_dash-layout"):
        status, headers, content = asked(proxy, path)
        assert status == 302
        assert f"/oauth2/sign_in?rd=http://{HOST}{path}\n" in headers
        assert b"aerocal_" not in content


def test_who_has_signed_in_sees_the_page_without_any_password(proxy: int) -> None:
    status, headers, content = asked(proxy, "/", Cookie="signed-in=yes")
    assert status == 200
    assert b"aerocal production" in content
    assert PASSWORD not in headers
    assert b"aerocal_runs" in asked(proxy, "/metrics", Cookie="signed-in=yes")[2]


def test_requests_of_foreign_pages_are_refused_behind_the_proxy_too(proxy: int) -> None:
    assert asked(proxy, "/health", Cookie="signed-in=yes", Origin=f"https://{HOST}")[0] == 200
    foreign = asked(proxy, "/health", Cookie="signed-in=yes", Origin="https://elsewhere.example.org")
    assert foreign[0] == 403
