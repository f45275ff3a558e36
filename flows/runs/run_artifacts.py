"""The short text that a run shows in Prefect's dashboard besides its state."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from flows.runs.project_run import RunOutcome, RunRequest
from flows.runs.recorded_run import FlowRunIdentity
from tasks.production.notice import report_address
from tasks.production.run_record import PUBLISHING, State, project_name
from tasks.production.short_text import ShortText
from tasks.production.variable import OVERVIEW_VARIABLE, RECORDS_VARIABLE


def text_of_outcome(outcome: RunOutcome, request: RunRequest, identity: FlowRunIdentity) -> ShortText:
    """The text of a run that has ended with an outcome."""
    project_file, state = request.project_file.absolute(), outcome.state
    overview = _overview() if state in PUBLISHING else None
    links = [] if overview is None else [("Report", report_address(overview, identity.id, identity.story))]
    place = outcome.place.absolute() if isinstance(outcome.place, Path) else outcome.place
    return ShortText(
        project_name(project_file),
        project_file,
        identity.story,
        state,
        outcome.message,
        outcome.summary.problems if state in PUBLISHING else (),
        str(place),
        [*links, *_page()],
    )


def text_of_refusal(project: str | Path, state: State, message: str, identity: FlowRunIdentity) -> ShortText:
    """The text of a run that has no outcome.

    Parameters
    ----------
    project : its file; a text: as given, where there is none.
    """
    place = Path(project)
    name = project_name(place) or str(project)
    return ShortText(name, place, identity.story, state, message, links=_page())


def _page() -> list[tuple[str, str]]:
    overview = _overview()
    return [] if overview is None else [("Production page", f"{overview}/")]


def _overview(environment: Mapping[str, str] = os.environ) -> str | None:
    """Address of the production page that shows the runs of this process; None: there is none."""
    base = environment.get(OVERVIEW_VARIABLE)
    return base.rstrip("/") if base and environment.get(RECORDS_VARIABLE) else None
