"""What a run shows in the dashboard besides its state: composed here, stored by the flow it belongs to."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from flows.project_run import RunOutcome, RunRequest
from flows.recorded_run import FlowRunIdentity
from flows.run_state import state_message, state_name
from tasks.dashboard.artifacts import DashboardArtifact, dashboard_artifacts
from tasks.dashboard.run import EndedRun
from tasks.production.records import project_name
from tasks.production.run_record import State
from tasks.production.variable import OVERVIEW_VARIABLE, RECORDS_VARIABLE

#: Name of the failed state of a flight check whose estimates are not what was simulated.
CONTRADICTS_TRUTH = "ContradictsTruth"

_log = logging.getLogger("aerocal")


def artifacts_of_outcome(
    outcome: RunOutcome, request: RunRequest, identity: FlowRunIdentity
) -> tuple[DashboardArtifact, ...]:
    """The artifacts of a run that has ended with an outcome."""
    return _composed(replace(_ended(outcome, request, identity), results=results_address(identity.id)))


def artifacts_beside_records(
    outcome: RunOutcome,
    request: RunRequest,
    identity: FlowRunIdentity,
    contradictions: Sequence[str] = (),
) -> tuple[DashboardArtifact, ...]:
    """The artifacts of a run that the records of production do not know: nobody serves its files.

    Parameters
    ----------
    contradictions : sentences on estimates that contradict the known truth.
    """
    run = _ended(outcome, request, identity)
    if contradictions:
        run = replace(run, state=CONTRADICTS_TRUTH, message=" ".join(contradictions))
    return _composed(run)


def _ended(outcome: RunOutcome, request: RunRequest, identity: FlowRunIdentity) -> EndedRun:
    project_file = request.project_file.absolute()
    return EndedRun(
        project_name(project_file),
        project_file,
        identity.story,
        state_name(outcome),
        state_message(outcome),
        outcome.directory.absolute(),
        str(outcome.place.absolute() if isinstance(outcome.place, Path) else outcome.place),
        outcome.summary,
    )


def artifacts_of_refusal(
    project: str, state: State, message: str, identity: FlowRunIdentity
) -> tuple[DashboardArtifact, ...]:
    """The artifact of a run that has come to no outcome.

    Parameters
    ----------
    project : as it was named.
    """
    place = Path(project)
    folder = place.parent if place.suffix == ".toml" else place
    return _composed(EndedRun(folder.name or project, place, identity.story, state, message))


def results_address(run_id: str, environment: Mapping[str, str] = os.environ) -> str | None:
    """Address below which the published files of a recorded run are served; None: nowhere."""
    base = environment.get(OVERVIEW_VARIABLE)
    if not base or not environment.get(RECORDS_VARIABLE):
        return None
    return f"{base.rstrip('/')}/results/{run_id}"


def _composed(run: EndedRun) -> tuple[DashboardArtifact, ...]:
    try:
        return dashboard_artifacts(run)
    # Whatever it is: a run that has ended well does not fail for what is said about it.
    except Exception as error:
        _log.warning("the artifacts of this run could not be made: %s: %s", type(error).__name__, error)
        return ()
