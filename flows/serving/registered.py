"""The stories as Prefect flows: name, run name, timeout, and how an outcome becomes a state.

Imports Prefect when imported. Deployments and ``--server`` come through here; the stories
themselves know nothing of it. Annotations are evaluated on purpose: Prefect builds its forms from
them when a deployment is served.
"""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Literal
from uuid import UUID

from flows.server.prefect_settings import prepare_prefect

prepare_prefect()

from prefect import Flow, flow  # noqa: E402
from prefect.client.orchestration import get_client  # noqa: E402
from prefect.client.schemas.actions import ArtifactCreate  # noqa: E402
from prefect.client.schemas.objects import State  # noqa: E402
from prefect.runtime import flow_run  # noqa: E402
from prefect.states import Completed, Failed, raise_state_exception  # noqa: E402

from flows.runs.examination_request import ExaminationRequest  # noqa: E402
from flows.runs.project_run import RunOutcome, RunRequest, Story, StoryName, story_named  # noqa: E402
from flows.runs.recorded_run import FlowRunIdentity, carry_out_recorded  # noqa: E402
from flows.runs.run_artifacts import CONTRADICTS_TRUTH, text_of_outcome  # noqa: E402
from flows.runs.run_state import STATE_NAMES, state_message, state_name  # noqa: E402
from tasks.errors import InputError  # noqa: E402
from tasks.object_storage.address import ObjectAddress  # noqa: E402
from tasks.production.short_text import ShortText  # noqa: E402
from tasks.results.summary import failed_summary, read_summary  # noqa: E402
from tasks.settings.load_simulation import load_simulation  # noqa: E402

_HOUR_S = 3600
_log = logging.getLogger("aerocal")


def run_name() -> str:
    """Name of a flow run: folder and name of its project file."""
    project_file = Path(str(flow_run.parameters["project_file"]))
    return f"{project_file.absolute().parent.name}/{project_file.name}"


def state_of(outcome: RunOutcome) -> State[None]:
    """The Prefect state of a finished run: Completed, or Failed under the name of what went wrong."""
    if outcome.summary.status == "done":
        return Completed(message=state_message(outcome))
    return Failed(name=state_name(outcome), message=state_message(outcome))


def identity() -> FlowRunIdentity:
    """The identity of the active flow run on the server."""
    return FlowRunIdentity(str(flow_run.id), str(flow_run.flow_name))


def show(text: ShortText) -> None:
    """Store the text of the active flow run; a refusal by the server is reported."""
    try:
        artifact = ArtifactCreate(
            key=f"{text.key}-verdict",
            type="markdown",
            description=text.line,
            data=text.markdown,
            flow_run_id=UUID(str(flow_run.id)),
        )
        with get_client(sync_client=True) as client:
            client.create_artifact(artifact)
    # Whatever it is: the run is done, and its results are there.
    except Exception as error:
        _log.warning("the text of this run was not stored: %s: %s", type(error).__name__, error)


def _story_flow(
    name: str,
    description: str,
    story_of: Callable[[RunRequest], Story],
    *,
    hours: int = 12,
    requested: type[RunRequest] = RunRequest,
) -> "Flow[..., State[None]]":
    """The flow of a story on a project file."""

    def run(
        project_file: str,
        out: str | None = None,
        overrides: list[str] | None = None,
        data: str | None = None,
    ) -> State[None]:
        """Run the story.

        Parameters
        ----------
        project_file : the project's TOML file.
        out : output folder or ``s3://BUCKET/PREFIX``; by default ``results`` next to the project file.
        overrides : values to replace, each as ``a.b.c=VALUE``.
        data : a second folder for relative input paths.
        """
        folder = Path(data) if data is not None else None
        request = requested.of(Path(project_file), out, tuple(overrides or ()), folder)
        outcome = carry_out_recorded(story_of(request), request, identity())
        show(text_of_outcome(outcome, request, identity()))
        return state_of(outcome)

    run.__name__ = name.replace("-", "_")
    made: Flow[..., State[None]] = flow(
        name=name,
        description=description,
        flow_run_name=run_name,
        timeout_seconds=hours * _HOUR_S,
        persist_result=False,
        validate_parameters=True,
    )(run)
    return made


def _sweep_of(request: RunRequest) -> Story:
    """The sweep of a request; loaded when it is required, as every story is."""
    from flows.stories.scenario_sweep import sweep_of

    return sweep_of(request)


def _always(story: StoryName | Literal["image_quality"]) -> Callable[[RunRequest], Story]:
    return lambda _request: story_named(story)


aerial_triangulation = _story_flow(
    "aerial-triangulation", "Adjust the block of a project file.", _always("aerial_triangulation")
)
direct_georeferencing_check = _story_flow(
    "direct-georeferencing-check",
    "Check the accuracy of GNSS, INS and the calibration of a project file without control points.",
    _always("direct_georeferencing_check"),
)
system_calibration = _story_flow(
    "system-calibration",
    "Calibrate camera, mounting and GNSS from the calibration flight of a project file.",
    _always("system_calibration"),
)
scenario_sweep = _story_flow(
    "scenario-sweep",
    "Adjust every scenario of a project's sweep: sub-blocks, control points, variants of the settings.",
    _sweep_of,
    hours=24,
)
image_quality = _story_flow(
    "image-quality",
    "Examine images: effective resolution, noise, defects of the sensor; radiometric certificate.",
    _always("image_quality"),
    requested=ExaminationRequest,
)


def check_name() -> str:
    """Name of a flight check's run: what is simulated."""
    return f"flight-check/{flow_run.parameters['simulation']}"


@flow(
    name="flight-check",
    flow_run_name=check_name,
    timeout_seconds=_HOUR_S,
    persist_result=False,
    validate_parameters=True,
)
def flight_check(
    simulation: str = "uce-low",
    out: str = "flight-check",
    overrides: list[str] | None = None,
    seed: int | None = None,
    calibrate: bool = False,
) -> State[None]:
    """Simulate a block, adjust it or calibrate from it, compare every estimate with the truth.

    Parameters
    ----------
    simulation : name of a preset, or path of a SPEC.toml.
    out : folder of the simulated project.
    overrides : values of the specification to replace, each as ``a.b.c=VALUE``.
    seed : of all random numbers.
    calibrate : run the system calibration, not the aerial triangulation alone.
    """
    from flows.stories.flight_check import flight_check as flight_check_story

    try:
        specification = load_simulation(simulation, tuple(overrides or ()), seed)
    except InputError as error:
        return Failed(name=STATE_NAMES["input_error"], message=str(error))
    check = flight_check_story(specification, Path(out), calibrates=calibrate)
    contradictions = () if check.comparison is None else check.comparison.contradictions()
    request = RunRequest(Path(out) / "project.toml")
    show(text_of_outcome(check.outcome, request, identity(), contradictions, recorded=False))
    if contradictions:
        return Failed(name=CONTRADICTS_TRUTH, message=" ".join(contradictions))
    return state_of(check.outcome)


def run_and_report(
    request: RunRequest, as_flow: "Flow[..., State[None]]" = aerial_triangulation
) -> RunOutcome:
    """Run a project here as a Prefect flow, with states and logs on the server.

    Parameters
    ----------
    request : the project.
    as_flow : one of the flows above that take a project file.

    Raises
    ------
    Exception
        What ended the flow without an outcome, as it was raised (a full disk, a defect).
    """
    state = as_flow(
        str(request.project_file.absolute()),
        _as_parameter(request.place),
        list(request.overrides),
        str(request.data.absolute()) if request.data is not None else None,
        return_state=True,
    )
    if state.name not in STATE_NAMES.values():
        raise_state_exception(state)
    without_result: tuple[Literal["input_error", "not_computable"], ...] = ("input_error", "not_computable")
    for status in without_result:
        if state.name == STATE_NAMES[status]:
            problem = state.message or ""
            return RunOutcome.of(request, failed_summary(status, problem, {}), problem)
    return RunOutcome.of(request, read_summary(request.directory))


def _as_parameter(out: Path | ObjectAddress | None) -> str | None:
    """An output location as the flows above accept it."""
    return str(out.absolute() if isinstance(out, Path) else out) if out is not None else None
