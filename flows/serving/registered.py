"""A run of a command as a Prefect flow, and what all runs show the server: identity, state, short text.

Imports Prefect when imported; the stories themselves know nothing of it.
"""

import logging
from collections.abc import Callable
from pathlib import Path
from uuid import UUID

import httpx

from flows.server.prefect_settings import prepare_prefect

prepare_prefect()

from prefect import flow
from prefect.client.orchestration import get_client
from prefect.client.schemas.actions import ArtifactCreate
from prefect.client.schemas.objects import State
from prefect.events.clients import PrefectEventsClient
from prefect.events.worker import EventsWorker
from prefect.runtime import flow_run
from prefect.states import Completed, Failed, raise_state_exception

from flows.runs.project_run import RunOutcome, RunRequest, Story
from flows.runs.recorded_run import FlowRunIdentity, carry_out_recorded, configured_overview, ended_run
from flows.server.api import configured_api
from tasks.files.installation import InstallationError
from tasks.production.run_record import RunRecord
from tasks.production.short_text import text_key, text_line, text_of

_HOUR_S = 3600
_log = logging.getLogger("aerocal")


def _without_traceback(said: logging.LogRecord) -> bool:
    """That a server does not answer is no defect; the log has one line of it."""
    if said.exc_info and isinstance(said.exc_info[1], httpx.HTTPError):
        said.exc_info = None
    return True


logging.getLogger("prefect.flow_runs").addFilter(_without_traceback)


def state_of(outcome: RunOutcome) -> State[None]:
    """The Prefect state of a finished run: Completed, or Failed under the name of what went wrong."""
    if outcome.summary.status == "done":
        return Completed(message=outcome.message)
    return Failed(name=outcome.state, message=outcome.message)


def identity(*, deployed: bool = True) -> FlowRunIdentity:
    """The identity of the active flow run on the server."""
    return FlowRunIdentity(str(flow_run.id), str(flow_run.flow_name), deployed)


def show(run: RunRecord) -> None:
    """Store the short text of the active flow run; a refusal by the server is reported."""
    try:
        artifact = ArtifactCreate(
            key=f"{text_key(run)}-verdict",
            type="markdown",
            description=text_line(run),
            data=text_of(run, configured_overview()),
            flow_run_id=UUID(str(flow_run.id)),
        )
        with get_client(sync_client=True) as client:
            client.create_artifact(artifact)
    # Whatever it is: the run is done, and its results are there.
    except Exception as error:
        _log.warning("the text of this run was not stored: %s: %s", type(error).__name__, error)


def run_and_report(request: RunRequest, name: str, story: Callable[[], Story]) -> RunOutcome:
    """Run a request here as a Prefect flow, with states and logs on the server.

    Parameters
    ----------
    name : of the story.
    story : loads it.

    Raises
    ------
    InstallationError
        If the server does not answer any more before the run begins.
    Exception
        What ended the flow without an outcome, as it was raised (a full disk, a defect).
    """
    ended: list[RunOutcome] = []
    failed: list[Exception] = []

    def run(project_file: str, out: str | None, overrides: list[str], data: str | None) -> State[None]:  # noqa: ARG001 - shown by the server
        try:
            ended.append(carry_out_recorded(story(), request, identity(deployed=False)))
        except Exception as error:
            failed.append(error)
            raise
        show(ended_run(ended[0], identity()))
        return state_of(ended[0])

    file, place = request.project_file.absolute(), request.place
    run.__name__ = name
    made = flow(
        name=name.replace("_", "-"),
        flow_run_name=lambda: f"{file.parent.name}/{file.name}",
        timeout_seconds=(24 if name == "scenario_sweep" else 12) * _HOUR_S,
        persist_result=False,
    )(run)
    out = None if place is None else str(place.absolute() if isinstance(place, Path) else place)
    data = None if request.data is None else str(request.data.absolute())
    try:
        state = made(str(file), out, list(request.overrides), data, return_state=True)
    except httpx.HTTPError as error:
        server = configured_api().url
        _send_no_more()
        if failed:
            raise failed[0] from None
        if not ended:
            remedy = "Start it, or run in process with --server none."
            raise InstallationError(f"The server {server} does not answer ({error}).", remedy) from error
        _log.warning("the server %s does not answer; how this run ended was not reported to it", server)
        return ended[0]
    if not ended:
        raise_state_exception(state)
    return ended[0]


def _send_no_more() -> None:
    """Try only once to send the events that still wait, each of which would take Prefect seconds."""
    for name in ("prefect.events.clients", "prefect._internal.concurrency"):
        logging.getLogger(name).disabled = True
    for worker in list(EventsWorker._instances.values()):  # type: ignore[misc] # of all classes
        client = getattr(worker, "_client", None)
        if isinstance(client, PrefectEventsClient):
            client._reconnection_attempts = 0
