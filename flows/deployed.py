"""The stories as deployments run them: a form of the settings, and nothing outside the configured folders.

Imports Prefect when imported, as `flows.registered` does. Annotations are evaluated on purpose, and
parameters described as Google does: Prefect builds its forms from them. The flows carry the names of those
that are run by hand, so that the dashboard shows all runs of a story together.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from flows.prefect_settings import prepare_prefect

prepare_prefect()

from prefect import Flow, flow  # noqa: E402
from prefect.client.orchestration import get_client  # noqa: E402
from prefect.client.schemas.objects import FlowRun, State  # noqa: E402
from prefect.runtime import flow_run  # noqa: E402
from prefect.states import Completed, Failed  # noqa: E402
from pydantic import Field  # noqa: E402

from flows.aerial_triangulation import aerial_triangulation as aerial_triangulation_story  # noqa: E402
from flows.direct_georeferencing_check import (  # noqa: E402
    direct_georeferencing_check as direct_georeferencing_story,
)
from flows.project_run import RunRequest, Story  # noqa: E402
from flows.recorded_run import carry_out_recorded, note_refusal  # noqa: E402
from flows.registered import identity, state_of  # noqa: E402
from flows.run_state import STATE_NAMES  # noqa: E402
from flows.serving.api import configured_api  # noqa: E402
from flows.serving.deliveries import StoryOfDeliveries, schedule_deliveries  # noqa: E402
from flows.serving.inbox import configured_inbox  # noqa: E402
from flows.serving.roots import configured_roots  # noqa: E402
from flows.serving.run_form import RunForm  # noqa: E402
from flows.system_calibration import system_calibration as system_calibration_story  # noqa: E402
from tasks.errors import InputError  # noqa: E402
from tasks.production.records import configured_records  # noqa: E402
from tasks.storage.installation import InstallationError  # noqa: E402

_HOUR_S = 3600
_log = logging.getLogger("aerocal")

ProjectParameter = Annotated[str, Field(min_length=1, max_length=1000)]
OutputParameter = Annotated[str, Field(pattern=r"^[^/\\]+$", max_length=100)]
#: The form as it is opened.
AS_IN_PROJECT = RunForm()


def run_name() -> str:
    """Name of a run that begins: project and story."""
    project = Path(str(flow_run.parameters["project"]))
    folder = project.parent if project.suffix == ".toml" else project
    return f"{folder.name or project.name} · {flow_run.flow_name}"


def name_outcome(flow: "Flow[..., Any]", flow_run: FlowRun, state: State[Any]) -> None:
    """Put the state a run ended in behind its name."""
    story = str(flow.name)
    project = flow_run.name.partition(f" · {story}")[0]
    with get_client(sync_client=True) as client:
        client.update_flow_run(flow_run.id, name=f"{project} · {story} · {state.name}")


def _confined(story: Story, project: str, settings: RunForm, output: str) -> State[None]:
    """Run a story on a project under the configured folders."""
    try:
        roots = configured_roots()
        file = roots.project_file(project)
        out = roots.output_folder(file, output)
        request = RunRequest(file, out, settings.overrides(), roots=roots.folders)
        return state_of(carry_out_recorded(story, request, identity()))
    except InputError as error:
        note_refusal(identity(), project, str(error))
        return Failed(name=STATE_NAMES["input_error"], message=str(error))
    except InstallationError as error:
        return Failed(message=str(error))


@flow(
    name="aerial-triangulation",
    flow_run_name=run_name,
    timeout_seconds=12 * _HOUR_S,
    persist_result=False,
    on_completion=[name_outcome],
    on_failure=[name_outcome],
)
def aerial_triangulation(
    project: ProjectParameter, settings: RunForm = AS_IN_PROJECT, output: OutputParameter = "results"
) -> State[None]:
    """Adjust the block of a project: orientations, object points and their precision, report, gates.

    Args:
        project: The project file or its folder; absolute, or as seen from a folder of this server.
        settings: What shall differ from the project file.
        output: Name of the folder of the results, beside the project file.
    """
    return _confined(aerial_triangulation_story, project, settings, output)


@flow(
    name="system-calibration",
    flow_run_name=run_name,
    timeout_seconds=12 * _HOUR_S,
    persist_result=False,
    on_completion=[name_outcome],
    on_failure=[name_outcome],
)
def system_calibration(
    project: ProjectParameter, settings: RunForm = AS_IN_PROJECT, output: OutputParameter = "results"
) -> State[None]:
    """Calibrate camera, mounting and GNSS from a calibration flight, with certificate.

    Args:
        project: The project file or its folder; absolute, or as seen from a folder of this server.
        settings: What shall differ from the project file.
        output: Name of the folder of the results, beside the project file.
    """
    return _confined(system_calibration_story, project, settings, output)


@flow(
    name="direct-georeferencing-check",
    flow_run_name=run_name,
    timeout_seconds=12 * _HOUR_S,
    persist_result=False,
    on_completion=[name_outcome],
    on_failure=[name_outcome],
)
def direct_georeferencing_check(
    project: ProjectParameter, settings: RunForm = AS_IN_PROJECT, output: OutputParameter = "results"
) -> State[None]:
    """Check what GNSS, INS and a calibration give without any control.

    Args:
        project: The project file or its folder; absolute, or as seen from a folder of this server.
        settings: What shall differ from the project file.
        output: Name of the folder of the results, beside the project file.
    """
    return _confined(direct_georeferencing_story, project, settings, output)


@flow(name="inbox", timeout_seconds=_HOUR_S, persist_result=False)
def inbox(story: StoryOfDeliveries = "aerial-triangulation") -> State[None]:
    """Start a run for every complete delivery of the inbox that has none yet.

    Args:
        story: What is done with deliveries.
    """
    records = configured_records()
    if records is None:
        raise InstallationError("This runner has no records of production.", "Start it with aerocal serve.")
    scheduled = schedule_deliveries(configured_api(), records, configured_inbox(), configured_roots(), story)
    for sentence in scheduled.sentences():
        _log.info(sentence)
    return Completed(message=" ".join(scheduled.sentences()))


#: The flows of a project, each with a deployment ``manual``.
STORIES: Sequence["Flow[..., State[None]]"] = (
    aerial_triangulation,
    system_calibration,
    direct_georeferencing_check,
)
