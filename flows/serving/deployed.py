"""The stories as deployments run them: a form of the settings, and nothing outside the configured folders.

Imports Prefect when imported, as `flows.serving.registered` does. Annotations are evaluated on purpose, and
parameters described as Google does: Prefect builds its forms from them. The flows carry the names of those
that are run by hand, so that the dashboard shows all runs of a story together.
"""

import logging
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from flows.server.prefect_settings import prepare_prefect

prepare_prefect()

from prefect import Flow, flow
from prefect.client.orchestration import get_client
from prefect.client.schemas.objects import FlowRun, State
from prefect.runtime import flow_run
from prefect.settings import get_current_settings
from prefect.states import Completed, Failed
from pydantic import AfterValidator, Field

from flows.runs.clean_up import Act, clean_up_below
from flows.runs.examination_request import ExaminationRequest
from flows.runs.project_run import RunRequest, StoryName, story_named
from flows.runs.recorded_run import (
    carry_out_recorded,
    ended_run,
    note_refusal,
    refused_run,
    tell_without_record,
)
from flows.runs.stage import state_name
from flows.server.api import configured_api
from flows.server.inbox import SEARCH, StoryOfDeliveries, configured_inbox, schedule_deliveries
from flows.server.roots import (
    OUTPUT_PATTERN,
    configured_results,
    configured_roots,
    output_name,
    registry_of_runner,
)
from flows.server.run_form import RunForm
from flows.serving.last_reports import reported_for_a_while
from flows.serving.registered import identity, show, state_of
from tasks.errors import AerocalError, InputError
from tasks.files.installation import InstallationError
from tasks.production.records import configured_records
from tasks.results.retention import KEEP_DAYS
from tasks.settings.registry import registry_address

_HOUR_S = 3600
#: How long a run that has ended reports to a server that does not answer, s. Prefect repeats a request
#: after 2, 4, 8, … s, each up to a fifth shorter; after the last one it would report what is done as failed.
REPORTING_S = 0.75 * (2.0 ** (get_current_settings().client.max_retries + 1) - 2.0)
_log = logging.getLogger("aerocal")

ProjectParameter = Annotated[str, Field(min_length=1, max_length=1000)]
Days = Annotated[int, Field(ge=0, le=36_500)]
Limit = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
CameraNames = Annotated[Sequence[str], Field(max_length=1000)]
#: Name of the failed state in which a camera needs a calibration.
RECALIBRATION_DUE = "RecalibrationDue"
OutputParameter = Annotated[
    str,
    Field(min_length=1, max_length=100, json_schema_extra={"pattern": OUTPUT_PATTERN}),
    AfterValidator(output_name),
]
#: The form as it is opened.
AS_IN_PROJECT = RunForm()


def run_name() -> str:
    """Name of a new run: project and story."""
    project = Path(str(flow_run.parameters["project"]))
    folder = project.parent if project.suffix == ".toml" else project
    return f"{folder.name or project.name} · {flow_run.flow_name}"


def name_outcome(flow: "Flow[..., Any]", flow_run: FlowRun, state: State[Any]) -> None:
    """Append the final state of a run to its name."""
    story = str(flow.name)
    project = flow_run.name.partition(f" · {story}")[0]
    with get_client(sync_client=True) as client:
        client.update_flow_run(flow_run.id, name=f"{project} · {story} · {state.name}")


def _deployed(
    name: str, run_name: str | Callable[[], str], description: str | None = None, hours: int = 12
) -> Callable[[Callable[..., State[None]]], "Flow[..., State[None]]"]:
    """Make a function a flow whose runs carry their final state in their names."""
    return flow(
        name=name,
        description=description,
        flow_run_name=run_name,
        timeout_seconds=hours * _HOUR_S,
        persist_result=False,
        on_completion=[name_outcome],
        on_failure=[name_outcome],
    )


def _confined(
    story: StoryName | Literal["image_quality"],
    project: str,
    settings: RunForm,
    output: str,
    requested: type[RunRequest] = RunRequest,
) -> State[None]:
    """Run a story on a project under the configured folders."""
    about: str | Path = project
    try:
        roots = configured_roots()
        about = file = roots.project_file(project)
        out = roots.output_folder(file, output)
        address = configured_results(file, output, roots)
        request = requested(file, out, settings.overrides(), roots=roots.folders, address=address)
        with reported_for_a_while(REPORTING_S):
            outcome = carry_out_recorded(story_named(story), request, identity())
    except (InputError, InstallationError) as error:
        run = refused_run(about, state_name(error), str(error), identity())
        if isinstance(error, InputError):
            note_refusal(run)
        show(run)
        return _failed(error)
    show(ended_run(outcome, identity()))
    return state_of(outcome)


def _failed(error: AerocalError) -> State[None]:
    return Failed(name=state_name(error), message=str(error))


def _search(about: str, search: Callable[[], Sequence[str]]) -> State[None]:
    """A run that is of no project: its sentences; nobody would hear of its failure otherwise."""
    try:
        with reported_for_a_while(REPORTING_S):
            sentences = search()
    except (InputError, InstallationError) as error:
        tell_without_record(identity(), about, state_name(error), str(error))
        return _failed(error)
    for sentence in sentences:
        _log.info(sentence)
    return Completed(message=" ".join(sentences))


def _story_flow(story: StoryName, description: str) -> "Flow[..., State[None]]":
    """The flow of a story on a project of this server.

    The runner makes the flows and never computes; the process of a run loads the one story that it needs.
    """

    def run(
        project: ProjectParameter, settings: RunForm = AS_IN_PROJECT, output: OutputParameter = "results"
    ) -> State[None]:
        """Run the story.

        Args:
            project: The project file or its folder; absolute, or relative to a folder of this server.
            settings: Settings that differ from the project file.
            output: Name of the folder of the results, next to the project file.
        """
        return _confined(story, project, settings, output)

    run.__name__ = story
    return _deployed(story.replace("_", "-"), run_name, description)(run)


aerial_triangulation = _story_flow(
    "aerial_triangulation",
    "Adjust the block of a project: orientations, object points and their precision, report, gates.",
)
system_calibration = _story_flow(
    "system_calibration",
    "Calibrate camera, mounting and GNSS from a calibration flight, with certificate.",
)
direct_georeferencing_check = _story_flow(
    "direct_georeferencing_check",
    "Check the accuracy of GNSS, INS and a calibration without control points.",
)


@_deployed(
    "image-quality",
    run_name,
    "Examine images: effective resolution, noise, defects of the sensor, with certificate.",
)
def image_quality(project: ProjectParameter, output: OutputParameter = "image-quality") -> State[None]:
    """Examine the images that a file with a table [image_quality] names.

    Args:
        project: The file or its folder; absolute, or relative to a folder of this server.
        output: Name of the folder of the results, beside the file.
    """
    return _confined("image_quality", project, AS_IN_PROJECT, output, ExaminationRequest)


@_deployed(SEARCH, "deliveries · inbox", hours=1)
def inbox(story: StoryOfDeliveries = "aerial-triangulation") -> State[None]:
    """Start a run for every complete new delivery of the inbox.

    Args:
        story: Flow to run for each delivery.
    """

    def search() -> Sequence[str]:
        records, folder, roots = configured_records(), configured_inbox(), configured_roots()
        if records is None:
            raise InstallationError(
                "This runner has no records of production.", "Start it with aerocal serve."
            )
        return schedule_deliveries(configured_api(), records, folder, roots, story).sentences()

    return _search(SEARCH, search)


@_deployed("recalibration-due", "registry · recalibration-due", hours=1)
def recalibration_due(
    within_days: Days = 30,
    max_age_days: Days = 730,
    sigma: Limit | None = None,
    focal_length_um: Limit | None = None,
    principal_point_um: Limit | None = None,
    boresight_deg: Limit | None = None,
    lever_arm_mm: Limit | None = None,
    without: CameraNames = (),
) -> State[None]:
    """Report cameras that need a calibration: none in force, expiring, too old, or drifted.

    Args:
        within_days: A calibration that expires within this number of days is due.
        max_age_days: Maximum age of a calibration in days, counted from the flight; 0 for no limit.
        sigma: Limit of the change of a single parameter, in σ; empty for one false alarm in 1,000.
        focal_length_um: Additional absolute limit for the change of the focal length, in µm.
        principal_point_um: The same for each coordinate of the principal point, in µm.
        boresight_deg: The same for each angle of the boresight, in degrees.
        lever_arm_mm: The same for each component of the lever arm, in mm.
        without: Cameras to exclude; name, body or lens of each.
    """
    # Every run would load them otherwise, and pandas and scipy with them.
    from tasks.registry.drift import DriftLimits
    from tasks.registry.due import DueLimits
    from tasks.registry.registry import Registry
    from tasks.registry.watch import watch_of

    drift = DriftLimits(sigma, focal_length_um, principal_point_um, boresight_deg, lever_arm_mm)
    limits = DueLimits(within_days, max_age_days or None, drift, tuple(without))
    due: list[object] = []

    def search() -> Sequence[str]:
        registry = Registry.at(registry_address(registry_of_runner(configured_roots())))
        watch = watch_of(registry.contents(), date.today(), limits)
        due.extend(watch.due)
        return watch.sentences

    state = _search("registry", search)
    if not due:
        return state
    tell_without_record(identity(), "registry", RECALIBRATION_DUE, str(state.message))
    return Failed(name=RECALIBRATION_DUE, message=state.message)


@_deployed("clean-up", "output folders · clean-up")
def clean_up(keep_days: Days = KEEP_DAYS, act: Act = "remove") -> State[None]:
    """Remove stored results of stages that have not been used for long; files listed in a manifest are kept.

    Args:
        keep_days: Days to keep a stored result after its last use.
        act: Remove them, or only report what would be removed.
    """
    return _search(
        "output folders", lambda: clean_up_below(configured_roots().folders, keep_days, act).sentences
    )


#: The flows of a project, each with a deployment ``manual``.
STORIES: Sequence["Flow[..., State[None]]"] = (
    aerial_triangulation,
    system_calibration,
    direct_georeferencing_check,
    image_quality,
)
#: All that a runner carries out, whatever the server says.
FLOWS: Sequence["Flow[..., State[None]]"] = (*STORIES, inbox, recalibration_due, clean_up)
