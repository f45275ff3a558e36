"""A real ``aerocal serve`` for the tests: a free port, a folder of its own, nothing left behind."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import psutil
from playwright.sync_api import Page

from flows.server.api import Api
from flows.server.server_process import SERVER_PASSWORD
from flows.server.state_file import kept_password
from tasks.production.records import Records
from tests.ports import free_port
from tests.service.stored_block import made_once
from tests.waiting import until

T = TypeVar("T")
START_S = 200.0


@dataclass
class Served:
    """A running server.

    Attributes
    ----------
    folder : holds root/, inbox/, state/ and what it printed.
    port, overview : of the server, and of the production page.
    given : what it was told to ask for; None: it has made a secret of its own.
    """

    folder: Path
    process: subprocess.Popen[bytes]
    port: int
    overview: int
    given: str | None = None

    @property
    def password(self) -> str:
        """What it asks for."""
        password = self.given or kept_password(self.folder / "state")
        assert password is not None, "it has made no secret"
        return password

    @property
    def link(self) -> str:
        """What lets a browser in."""
        return (self.folder / "state" / "link").read_text().strip()

    def let_in(self, page: Page) -> None:
        """Open the link and wait until the browser has the cookie: a page asked for before is the door's.

        It has it when it is sent to the dashboard, which takes seconds to draw itself.
        """
        page.goto(self.link, timeout=60_000)
        page.wait_for_url(f"http://127.0.0.1:{self.port}/v2/**", wait_until="commit", timeout=60_000)

    @property
    def api(self) -> Api:
        return Api(f"http://127.0.0.1:{self.port}/api", self.password)

    @property
    def environment(self) -> dict[str, str]:
        return environment(self.folder)

    @property
    def records(self) -> Records:
        return Records.at(str(self.folder / "state" / "records.sqlite"))

    def group_of(self, module: str) -> int:
        """The process group of the child that carries out a module."""
        for group in self.groups():
            if module in Path(f"/proc/{group}/cmdline").read_text().split("\0"):
                return group
        raise AssertionError(f"no child carries out {module}")

    @property
    def printed(self) -> str:
        return (self.folder / "printed").read_text()

    def start(self, deployment: str, parameters: Mapping[str, Any], **more: Any) -> str:
        """Start a run by hand; its id."""
        found = self.api.get(f"/deployments/name/{deployment}")
        run = self.api.post(f"/deployments/{found['id']}/create_flow_run", {"parameters": parameters, **more})
        return str(run["id"])

    def run(self, identity: str) -> Any:
        return self.api.get(f"/flow_runs/{identity}")

    def in_state(self, identity: str, kind: str, seconds: float = 120.0) -> Any:
        """The run once it is in a state of this type."""
        return until(lambda: run if (run := self.run(identity))["state_type"] == kind else None, seconds)

    def ended(self, identity: str, seconds: float = 150.0) -> Any:
        """The run once it has ended."""
        final = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")

        def ended() -> Any:
            run = self.run(identity)
            return run if run["state_type"] in final else None

        # Every question costs the server a hundredth of a second.
        return until(ended, seconds, pause_s=0.5)

    def runs(self, **filters: Any) -> list[Any]:
        return list(self.api.post("/flow_runs/filter", filters))

    def groups(self) -> set[int]:
        """The process groups of its children."""
        return groups_of(self.process.pid)


def groups_of(process: int) -> set[int]:
    """The process groups of the children of a process."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return {os.getpgid(int(child)) for child in children}


def environment(folder: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    return {**kept, "AEROCAL_STATE": str(folder / "state")}


#: Starts the application of Prefect's server, and ends at once; its own end waits for what nobody asks for.
_ONE_START = """
import asyncio, os
from prefect.server.api.server import create_app
async def start():
    app = create_app(webserver_only=True)
    async with app.router.lifespan_context(app):
        os._exit(0)
asyncio.run(start())
"""


@functools.cache
def started_once() -> Path:
    """Prefect's folder after a first start: its tables and kinds of blocks, which take it longest to make."""

    def start(home: Path) -> None:
        variables = {
            "PREFECT_HOME": str(home),
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
            "DO_NOT_TRACK": "1",
        }
        command = [sys.executable, "-c", _ONE_START]
        subprocess.run(command, env={**environment(home), **variables}, capture_output=True, check=True)

    return made_once("prefect", start)


def recorded_states(folder: Path) -> dict[str, str]:
    """The state of every run by its name, from the database of a server that has ended."""
    with closing(sqlite3.connect(folder / "state" / "prefect" / "prefect.db")) as database:
        return dict(database.execute("SELECT id, state_type FROM flow_run WHERE state_type != 'SCHEDULED'"))


def alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def engines_of(runner: int) -> list[int]:
    """The processes that carry out the runs of a runner: those that its fork server has forked."""
    with contextlib.suppress(psutil.NoSuchProcess):
        for process in psutil.Process(runner).children():
            if "flows.serving.preload" in " ".join(process.cmdline()):
                return [child.pid for child in process.children()]
    return []


@contextmanager
def further_runner(
    server: Served, *options: str, root: str = "root", **variables: str
) -> Iterator[subprocess.Popen[bytes]]:
    """A second runner for a server, for one of its folders and with these variables; killed afterwards."""
    folder = str(server.folder / root)
    command = [sys.executable, "-m", "flows.command", "runner", "--root", folder, *options]
    printed = server.folder / "printed-runner"
    with printed.open("wb") as stream:
        process = subprocess.Popen(
            command, stdout=stream, stderr=stream, env={**server.environment, **variables}
        )
    log = server.folder / "state" / "logs" / "runner-2.log"
    try:
        until(lambda: "Ready." in printed.read_text() and log.is_file(), START_S, process)
        yield process
    finally:
        # A second request ends the runs, too.
        for _ in range(2):
            if process.poll() is None:
                process.terminate()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(30)


@contextmanager
def served(
    folder: Path, *options: str, cwd: Path | None = None, first_start: bool = False, **variables: str
) -> Iterator[Served]:
    """A server that is ready, over folder/root and folder/inbox; killed with all its children afterwards.

    Its environment has these variables besides; it is started in the folder cwd. Where it has no state yet it
    gets a folder that Prefect has started in once, unless first_start.
    """
    for name in ("root", "inbox"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    state = folder / "state"
    if not (first_start or "--database" in options):
        # The first start has stored the kinds of blocks; each further one compares them for a second.
        variables["PREFECT_SERVER_REGISTER_BLOCKS_ON_START"] = "false"
        if not state.exists():
            state.mkdir(mode=0o700)
            shutil.copytree(started_once(), state / "prefect")
    port = free_port("127.0.0.1")
    overview = free_port("127.0.0.1")
    ports = ["--port", str(port), "--overview-port", str(overview)]
    command = [sys.executable, "-m", "flows.command", "serve", *ports]
    places = ["--root", str(folder / "root"), "--inbox", str(folder / "inbox"), "--watch", "2"]
    with (folder / "printed").open("wb") as printed:
        process = subprocess.Popen(
            [*command, *places, *options],
            stdout=printed,
            stderr=printed,
            env={**environment(folder), **variables},
            cwd=cwd,
        )
    server = Served(folder, process, port, overview, variables.get(SERVER_PASSWORD))
    groups: set[int] = set()
    try:
        until(lambda: "Ready." in server.printed, START_S, process)
        groups = server.groups()
        assert len(groups) == 2, "server and runner are in groups of their own"
        yield server
    finally:
        if process.poll() is None:
            groups |= server.groups()
            process.kill()
            process.wait()
        for group in groups:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(group, signal.SIGKILL)
