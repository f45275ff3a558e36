"""The program of the runner: registers the deployments of the stories and carries out their runs.

Prefect's own runner carries out what its server says, and ends when that is away; ours does neither. Loads
Prefect when imported, as the flows it serves do.
"""

import asyncio
import logging
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from functools import partial, wraps
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx

from flows.server.api import Api
from flows.server.inbox import MANUAL, ON_DELIVERY
from flows.server.roots import Roots
from flows.server.settings import Settings, settings_of_runner
from flows.serving.deployed import STORIES, clean_up, inbox, recalibration_due
from flows.serving.fork import ForkingStarter
from flows.serving.readable import Readable
from flows.serving.served_places import ServedPlaces, places_in, places_of, schema_of

from prefect.client.orchestration import PrefectClient, get_client  # isort: skip
from prefect import Flow  # isort: skip
from prefect.client.schemas.objects import FlowRun  # isort: skip
from prefect.client.schemas.filters import DeploymentFilter, DeploymentFilterTags  # isort: skip
from prefect.deployments.runner import RunnerDeployment  # isort: skip
from prefect.runner import Runner  # isort: skip
from prefect.schedules import Cron  # isort: skip
from prefect.types.entrypoint import EntrypointType  # isort: skip
from prefect.utilities.callables import ParameterSchema  # isort: skip

_log = logging.getLogger("aerocal")

#: Tag of every deployment of ours.
TAG = "aerocal"
#: Names of the deployments with a schedule.
NIGHTLY = "nightly"
RECALIBRATION_DUE = "recalibration-due"
CLEAN_UP = "clean-up"
_SCHEDULED = (NIGHTLY, RECALIBRATION_DUE)
#: Every night at three.
_DAILY = "0 3 * * *"
#: Seconds between two questions for runs to begin.
_POLL_S = 2.0
#: Seconds between two looks of a further runner for deployments.
_LOOK_S = 20.0


class DrainingRunner(Runner):
    """A runner for our flows only; when asked to end, it starts no further run and waits.

    Prefect's own handler ends the process from within the signal; what becomes of the runs depends on what
    the event loop was doing. And while the server is away, this runner continues asking: Prefect's own ends
    after three questions without an answer, and its runs with it.

    Parameters
    ----------
    limit : runs at the same time.
    roots : a further runner takes only runs of projects in these folders; None: it takes all, and those of
        projects that are nowhere end as such.
    """

    def __init__(self, limit: int, roots: Roots | None = None) -> None:
        super().__init__(name="aerocal", pause_on_shutdown=False, limit=limit, query_seconds=_POLL_S)
        # Prefect's own folder lies in one of the user who was the first to start a runner on this machine.
        self._tmp_dir = Path(tempfile.mkdtemp(prefix="aerocal-runner-"))
        self._roots = roots

    async def __aenter__(self) -> "DrainingRunner":
        """Begin; requests are repeated from now on."""
        await super().__aenter__()
        # Every run starts our program, whatever pull steps and entry point the server has for it.
        starter = ForkingStarter(self._tmp_dir, self._control_channel)
        vars(self._scheduled_run_poller)["_resolve_starter"] = lambda _run: starter
        assert self._hook_runner is not None
        self._hook_runner._resolve_flow = _flow_of_ours
        for asking, question in (
            (self._scheduled_run_poller, "_get_and_submit_flow_runs"),
            (self._cancelling_observer, "_check_for_cancelled_flow_runs"),
        ):
            vars(asking)[question] = _patient(getattr(asking, question))
        if self._roots is not None:
            poller = self._scheduled_run_poller
            found = poller._get_scheduled_flow_runs
            vars(poller)["_get_scheduled_flow_runs"] = Readable(self._roots, self._folders).only(found)
        return self

    async def _folders(self) -> dict[UUID, tuple[Path, ...]]:
        """By deployment, the folders that its server takes relative paths from."""
        found = await self._client.read_deployments(deployment_filter=_ours())
        places = {one.id: places_in(one.parameter_openapi_schema) for one in found}
        return {one: place.folders for one, place in places.items() if place is not None}

    def handle_sigterm(self, *_args: Any, **_kwargs: Any) -> None:
        """Stop looking for runs; the context of the runner then waits for those that have started."""
        _log.info("stopping: finishing current runs, starting no new ones")
        assert self._loop is not None
        self._loop.call_soon_threadsafe(self._loops_task_group.cancel_scope.cancel)


async def _flow_of_ours(_run: FlowRun) -> Flow[..., Any]:
    """Stand-in for the flow of any run when hooks are looked up; ours have none that a runner would call."""
    return STORIES[0]


def _patient(question: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    """A request to the server that is repeated if there is no answer."""

    @wraps(question)
    async def asked(*args: Any, **kwargs: Any) -> None:
        try:
            await question(*args, **kwargs)
        except httpx.HTTPError as error:
            _log.warning("the server does not answer (%s); retrying", str(error).partition("\n")[0])

    return asked


def deployments(settings: Settings) -> list[RunnerDeployment]:
    """The deployments for these options; to be called outside an event loop."""
    of = partial(_of, places_of(settings))
    made = [of(story, MANUAL, "Started manually.") for story in STORIES]
    by = partial(Cron, timezone=settings.timezone)
    if settings.inbox is not None:
        story = next(one for one in STORIES if one.name == settings.story)
        made.append(of(story, ON_DELIVERY, "Started for each complete delivery of the inbox."))
        words = "Searches the inbox and starts runs for new deliveries."
        schedule = by(settings.cron) if settings.cron else None
        made.append(of(inbox, NIGHTLY, words, schedule=schedule, parameters={"story": settings.story}))
    if settings.recalibration_cron is not None:
        words, schedule = (
            "Searches the registry for calibrations that are due.",
            by(settings.recalibration_cron),
        )
        made.append(of(recalibration_due, RECALIBRATION_DUE, words, schedule=schedule))
    if settings.keep_days is not None:
        parameters = {"keep_days": settings.keep_days}
        made.append(of(clean_up, CLEAN_UP, "Every night.", schedule=by(_DAILY), parameters=parameters))
    return made


def _of(places: ServedPlaces, story: Any, name: str, description: str, **more: Any) -> RunnerDeployment:
    made: RunnerDeployment = story.to_deployment(
        name,
        description=f"{story.description} {description}",
        tags=[TAG],
        entrypoint_type=EntrypointType.MODULE_PATH,
        **more,
    )
    schema = made._parameter_openapi_schema
    # Said, not left to its default: what is not set is not sent.
    made._parameter_openapi_schema = _ClosedSchema(
        **schema.model_dump(exclude_unset=True),
        additionalProperties=False,
        **schema_of(places),
    )
    return made


class _ClosedSchema(ParameterSchema, extra="allow"):
    """A schema that permits no other parameters: the server refuses a run with unknown ones."""

    additionalProperties: bool  # noqa: N815


def main() -> None:
    """Register the deployments, and carry out their runs until asked to end."""
    logging.getLogger("aerocal").setLevel(logging.INFO)
    # Every two seconds as long as runs wait for their turn.
    logging.getLogger("prefect.runner").addFilter(lambda said: "skipped (at capacity)" not in said.msg)
    settings = settings_of_runner()
    if settings.registers:
        made = deployments(settings)
        # It is started at the same time; who has started both ends this process if the server fails.
        while not Api(settings.address.api).is_well():
            time.sleep(0.2)
        asyncio.run(_serve(settings.limit, made))
    else:
        asyncio.run(_help(settings.limit, settings.roots))


async def _serve(limit: int, made: list[RunnerDeployment]) -> None:
    runner = DrainingRunner(limit)
    unscheduled = [one.name for one in made if one.name in _SCHEDULED and not one.schedules]
    registered = {await runner.aadd_deployment(one) for one in made}
    async with get_client() as client:
        await _rest(client, registered, unscheduled)
    await runner.start()


async def _help(limit: int, roots: Roots) -> None:
    """Carry out runs of the deployments that the server's own runner has registered or will register."""
    runner = DrainingRunner(limit, roots)
    async with get_client() as client, asyncio.TaskGroup() as tasks:
        looking = tasks.create_task(_look_for_deployments(client, runner))
        await runner.start()
        looking.cancel()


async def _look_for_deployments(client: PrefectClient, runner: DrainingRunner) -> None:
    """Let a runner carry out the runs of projects; looks for new deployments regularly.

    What looks through inbox and registry is left to the runner that has been told of them.
    """

    async def look() -> None:
        for one in await client.read_deployments(deployment_filter=_ours()):
            if one.name in (MANUAL, ON_DELIVERY):
                runner._deployment_registry.register_deployment(one.id, one.name)

    while True:
        await _patient(look)()
        await asyncio.sleep(_LOOK_S)


async def _rest(client: PrefectClient, registered: set[Any], unscheduled: Sequence[str]) -> None:
    """Remove schedules of an earlier start that this runner does not carry out.

    Schedules that people have made in the dashboard, and what they have paused, stay.
    """
    for one in await client.read_deployments(deployment_filter=_ours()):
        if one.id in registered and one.name not in unscheduled:
            continue
        for schedule in await client.read_deployment_schedules(one.id):
            await client.delete_deployment_schedule(one.id, schedule.id)


def _ours() -> DeploymentFilter:
    return DeploymentFilter(tags=DeploymentFilterTags(all_=[TAG]))
