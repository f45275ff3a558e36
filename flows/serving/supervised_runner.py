"""What a server and a further runner do alike: prepare, start a runner, look after it, let it finish."""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Callable, Sequence

from flows.server.api import Api
from flows.server.child import Child, Lifeline, Requests, Say, Supervised
from flows.server.claims import DatabaseClaim
from flows.server.prefect_settings import prepare_prefect
from flows.server.server_process import CLIENT_PASSWORD
from flows.server.settings import Settings
from flows.server.state_file import make_private
from tasks.files.installation import InstallationError
from tasks.plain_text import visible
from tasks.production.records import Records

#: Of the folder for temporary files, bytes: sockets of Python's fork server (`flows.serving.fork`) lie in it,
#: and their paths have 107 at most (unix(7)).
_LONGEST_TEMPORARY = 75
#: Said when runs are taken.
READY = "Ready. Ctrl+C or SIGTERM stops it after the current runs have finished."


def prepared(settings: Settings) -> Records:
    """Make the process, its folder of states and Prefect ready for weeks of work; returns the records.

    Raises
    ------
    InstallationError
        If the path of the folder for temporary files is too long, or the records cannot be reached.
    """
    temporary = tempfile.gettempdir()
    if len(os.fsencode(temporary)) > _LONGEST_TEMPORARY:
        raise InstallationError(
            f"The path of the folder for temporary files has more than {_LONGEST_TEMPORARY} characters: "
            f"{visible(temporary)}.",
            "Set TMPDIR to a folder with a shorter path.",
        )
    # Other commands end soon (`flows.command`); this one runs for weeks.
    gc.set_threshold(50_000)
    make_private(settings.state)
    records = Records.at(settings.records)
    records.prepare()
    os.environ.setdefault("PREFECT_HOME", str(settings.state / "prefect"))
    prepare_prefect()
    return records


def started_runner(
    settings: Settings, api: Api, lifeline: Lifeline, holds: Sequence[Lifeline] = (), name: str = "runner"
) -> Child:
    """Start a runner; it loads what it needs, and waits for the server."""
    environment = {
        **os.environ,
        **settings.variables(),
        "PREFECT_API_URL": api.url,
        "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
        **({CLIENT_PASSWORD: api.password} if api.password else {}),
    }
    log = settings.state / "logs" / f"{name}.log"
    return Child(
        "flows.serving.deployments", environment=environment, log=log, lifeline=lifeline, holds=holds
    )


def stated_folders(settings: Settings) -> str:
    """The folders of projects, as a line for people."""
    return "Projects may be located under: " + ", ".join(map(str, settings.roots.folders))


def look_after(
    supervised: Sequence[Supervised | DatabaseClaim],
    requests: Requests,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Look after processes until asked to end, or until it is over."""
    while not requests.come.wait(1.0) and not is_over():
        for one in supervised:
            one.look()


def stopped(runner: Supervised, requests: Requests, say: Say) -> int:
    """Let the runner finish; returns the exit code."""
    say("Stopping after the current runs; a second request stops them now.")
    runner.drain(requests)
    return 0
