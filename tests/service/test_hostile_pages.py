"""What a page of others, a name turned to this machine, and another user can do at the ports of a server.

The browser is one that the link has let in, so everything a page of others could borrow from it is there.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import multiprocessing
import os
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import psutil
import pytest
from playwright.sync_api import BrowserContext, Error, Page

from flows.server.door import basic
from tests.chromium import chromium
from tests.flows.conftest import write_block
from tests.flows.test_delivered_modules import plant
from tests.service.served import Served, served

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"
NAMES = (
    "--host-resolver-rules=MAP evil.example 127.0.0.1, MAP rebound.example 127.0.0.1, MAP * ~NOTFOUND, "
    "EXCLUDE 127.0.0.1"
)
#: What a page of others tries at a port; what it could read, or saw happen, comes back.
ATTACK = """async ([port, deployment, steps]) => {
  const got = [], base = `http://127.0.0.1:${port}`;
  const within = (what, ms) =>
    Promise.race([what, new Promise(done => setTimeout(() => done("late"), ms))]);
  const run = JSON.stringify({parameters: {project: "block"}});
  const made = JSON.stringify(
    {name: "manual", flow_id: steps.flow, pull_steps: steps.pull, entrypoint: "/tmp/x.py:f"});
  const asked = ["/", "/api/deployments/" + deployment, "/api/flow_runs/count", "/health", "/_dash-layout",
    "/ui-settings", "/openapi.json", "/enter"];
  const posts = [[`/api/deployments/${deployment}/create_flow_run`, run], ["/api/deployments/", made],
    ["/_dash-update-component", "{}"], ["/enter", '{"key":""}'],
    ["/api/admin/database/clear", '{"confirm":true}']];
  for (const credentials of ["include", "omit"]) {
    for (const path of asked) {
      try { got.push(["read", path, (await fetch(base + path, {credentials})).status]); }
      catch (refused) {}
    }
    for (const [path, body] of posts)
      for (const type of ["text/plain", "application/x-www-form-urlencoded", "application/json", ""])
        for (const mode of ["no-cors", "cors"]) {
          const headers = type ? {"Content-Type": type} : {};
          const content = type ? body : new Blob([body]);
          try {
            const sent = {method: "POST", mode, credentials, headers, body: content};
            const answer = await fetch(base + path, sent);
            if (answer.type !== "opaque") got.push(["posted", path, answer.status]);
          } catch (refused) {}
        }
  }
  const sockets = ["/api/events/out", "/api/logs/out", "/api/events/in",
    "/api/task_runs/subscriptions/scheduled"];
  for (const path of sockets)
    for (const protocols of [[], ["prefect"]]) {
      const heard = await within(new Promise(done => {
        const socket = new WebSocket(`ws://127.0.0.1:${port}${path}`, protocols);
        socket.onopen = () => done("open");
        socket.onerror = () => done("refused");
      }), 20000);
      if (heard !== "refused") got.push(["socket", path, protocols.join(), heard]);
    }
  const form = document.createElement("form");
  form.method = "POST"; form.enctype = "text/plain"; form.target = "frame";
  form.action = `${base}/api/deployments/${deployment}/create_flow_run`;
  form.innerHTML = "<input>";
  form.firstChild.name = '{"parameters":{"project":"block"},"x":"';
  form.firstChild.value = '"}';
  document.body.innerHTML += "<iframe name=frame></iframe>";
  document.body.append(form);
  form.submit();
  await new Promise(done => setTimeout(done, 500));
  return got;
}"""


class _OfOthers(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!DOCTYPE html><title>a page of others</title><body></body>")

    def log_message(self, *_arguments: object) -> None:
        """Quiet."""


@pytest.fixture(scope="module")
def page_of_others() -> Iterator[int]:
    """The port of a web server of somebody else."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _OfOthers) as others:
        threading.Thread(target=others.serve_forever, daemon=True).start()
        yield others.server_port
        others.shutdown()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("attacked")
    write_block(folder / "root" / "block")
    plant(folder / "root")
    # Where a delivery lies, as with `aerocal serve` in its folder.
    with served(folder, cwd=folder / "root") as running:
        yield running


@pytest.fixture(scope="module")
def known(server: Served) -> Iterator[BrowserContext]:
    """A browser that the link has let in."""
    # The name of a page must not be what keeps it out: no rule of the browser for networks of its own.
    with chromium(NAMES, "--disable-features=PrivateNetworkAccess,LocalNetworkAccessChecks") as browser:
        context = browser.new_context()
        page = context.new_page()
        server.let_in(page)
        page.close()
        yield context


@pytest.fixture
def page(known: BrowserContext) -> Iterator[Page]:
    page = known.new_page()
    yield page
    page.close()


def ports(server: Served) -> list[int]:
    """Every port that a process of the server listens on."""
    of_server = psutil.Process(server.process.pid)
    found: set[int] = set()
    for process in (of_server, *of_server.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            found |= {
                one.laddr.port for one in process.net_connections("inet") if one.status == psutil.CONN_LISTEN
            }
    assert {server.port, server.overview} <= found
    return sorted(found)


def deployment(server: Served) -> Any:
    return server.api.get(f"/deployments/name/{MANUAL}")


def changed(server: Served, **changes: Any) -> None:
    """Change the deployment as somebody may who knows the password."""
    address = f"{server.api.url}/deployments/{deployment(server)['id']}"
    headers = {"Content-Type": "application/json", "Authorization": basic(server.password)}
    request = urllib.request.Request(address, json.dumps(changes).encode(), headers, method="PATCH")
    urllib.request.urlopen(request, timeout=30).close()


def shell_step(file: Path) -> list[Any]:
    return [{"prefect.deployments.steps.run_shell_script": {"script": f"touch {file}"}}]


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1"])
def test_a_page_of_others_reads_nothing_and_starts_nothing(
    server: Served, known: BrowserContext, page: Page, page_of_others: int, host: str, tmp_path: Path
) -> None:
    """Also one of another port of this machine, which the browser takes for the same site."""
    before = deployment(server)
    steps = {"pull": shell_step(tmp_path / "done"), "flow": before["flow_id"]}
    for port in ports(server):
        # Of its own: the more sockets of a page were refused, the longer the browser has its next one wait.
        hostile = known.new_page()
        hostile.goto(f"http://{host}:{page_of_others}/")
        assert hostile.evaluate(ATTACK, [port, before["id"], steps]) == [], port
        hostile.close()
    assert server.runs() == []
    after = deployment(server)
    assert (after["pull_steps"], after["entrypoint"]) == (before["pull_steps"], before["entrypoint"])
    # The same calls are answered where they come from our own page.
    page.goto(f"http://127.0.0.1:{server.port}/")
    ours = page.evaluate("fetch('/api/flow_runs/count', {method: 'POST'}).then(answer => answer.text())")
    assert ours == "0"


def test_a_name_that_was_turned_to_this_machine_is_not_answered(
    server: Served, known: BrowserContext
) -> None:
    for port in ports(server):
        # Of its own: a page that shows an error goes nowhere else for a while.
        page = known.new_page()
        try:
            answer = page.goto(f"http://rebound.example:{port}/", wait_until="commit", timeout=10_000)
        except Error:
            # No web server.
            assert port not in (server.port, server.overview)
            page.close()
            continue
        assert answer is not None
        assert (answer.status, "rebound" in page.url) == (400, True), port
        for path in ("/api/flow_runs/count", "/enter", "/_dash-layout", "/api/health", "/health"):
            for method in ("GET", "POST"):
                call = f"fetch('{path}', {{method: '{method}'}}).then(answer => answer.status)"
                assert page.evaluate(call) == 400, (port, path, method)
        opened = page.evaluate(
            """port => new Promise(done => {
              const socket = new WebSocket(`ws://rebound.example:${port}/api/events/out`, ["prefect"]);
              socket.onopen = () => done(true); socket.onerror = () => done(false); })""",
            port,
        )
        assert not opened
        page.close()
    assert server.runs() == []


def _as_another_user(folder: str, processes: list[int], calls: list[tuple[int, str, str]], told: Any) -> None:
    """What a user without the secret gets; runs in a process of its own."""
    if os.getuid() == 0:
        os.setgroups([])
        os.setgid(65_534)
        os.setuid(65_534)
    got: list[tuple[object, ...]] = []
    files = [f"{folder}/state/{name}" for name in ("secret", "link", "serve.json", "prefect/prefect.db")]
    for file in (*files, *(f"/proc/{one}/environ" for one in processes)):
        with contextlib.suppress(OSError):
            got.append((file, len(Path(file).read_bytes())))
    for port, method, path in calls:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        try:
            connection.request(
                method, path, b"{}" if method == "POST" else None, {"Content-Type": "application/json"}
            )
            answer = connection.getresponse()
            said = answer.read()
            if answer.status not in (401, 403) and said != b"true":
                got.append((port, method, path, answer.status))
        except (OSError, http.client.HTTPException):
            pass
        finally:
            connection.close()
    told.send(got)


def test_another_user_of_the_machine_reads_nothing_and_starts_nothing(server: Served) -> None:
    one = deployment(server)["id"]
    read = (
        "/",
        "/v2/",
        "/openapi.json",
        "/api/health",
        f"/api/deployments/{one}",
        "/_dash-layout",
        "/health",
    )
    written = ("/api/flow_runs/filter", f"/api/deployments/{one}/create_flow_run", "/enter")
    paths = [("GET", path) for path in read] + [("POST", path) for path in written]
    calls = [(port, method, path) for port in ports(server) for method, path in paths]
    ours = psutil.Process(server.process.pid)
    processes = [ours.pid, *(child.pid for child in ours.children(recursive=True))]
    here, there = multiprocessing.Pipe()
    arguments = (str(server.folder), processes if os.getuid() == 0 else [], calls, there)
    other = multiprocessing.get_context("fork").Process(target=_as_another_user, args=arguments)
    other.start()
    assert here.poll(120)
    got = here.recv()
    other.join()
    if os.getuid() != 0:
        got = [one for one in got if isinstance(one[0], int)]
    assert got == []
    assert server.runs() == []
    for name in ("secret", "link"):
        assert (server.folder / "state" / name).stat().st_mode & 0o077 == 0


def test_pull_steps_and_entry_points_of_the_server_are_not_carried_out(
    server: Served, tmp_path: Path
) -> None:
    """Whoever put them there: here somebody who knows the password."""
    evil = tmp_path / "evil.py"
    evil.write_text(f"open({str(tmp_path / 'loaded')!r}, 'w')\ndef aerial_triangulation(**_): pass\n")
    changed(server, pull_steps=shell_step(tmp_path / "done"), entrypoint=f"{evil}:aerial_triangulation")
    run = server.ended(server.start(MANUAL, {"project": "block"}), 240)
    assert (run["state_name"], list(tmp_path.iterdir())) == ("Completed", [evil])
    assert (server.folder / "root" / "block" / "results" / "report.html").is_file()


def test_no_process_has_imported_a_module_of_a_delivery(server: Served) -> None:
    """Server, page, runner and the run above, all started in its folder."""
    assert server.runs()
    assert (server.folder / "root" / "json.py").is_file()
    assert list((server.folder / "traces").iterdir()) == []
