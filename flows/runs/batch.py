"""Many projects with one story, several at a time: each as if it had been run alone."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flows.runs.project_run import RunRequest, StoryName, carry_out, story_named
from flows.runs.stage import Attempt, stage
from flows.runs.workers import processors, workers
from tasks.errors import AerocalError, InputError
from tasks.files.delivered_file import is_there
from tasks.results.summary import Summary
from tasks.settings.base import variables_in
from tasks.settings.registry import REGISTRY_VARIABLE

_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class ProjectEnd:
    """How one project of a batch ended.

    Attributes
    ----------
    request : what was to be run.
    summary : content of its summary.json; None after an error of the machine or of aerocal.
    error : why there is no result, in one line; None if there is one.
    """

    request: RunRequest
    summary: Summary | None
    error: str | None = None


def carry_out_batch(
    requests: Sequence[RunRequest], story: StoryName | None, count: int | None
) -> tuple[ProjectEnd, ...]:
    """Run a story on every project, each in its own folder; one that fails does not stop the others.

    Parameters
    ----------
    requests : the projects, with absolute paths: a worker elsewhere has another working folder.
    story : None: of each project the one that its file declares.
    count : how many at a time on this machine; None: one per processor. A cluster has its own number. Not
        more are started than there are projects.

    Returns
    -------
    ends : in the order of `requests`.

    Raises
    ------
    InputError
        If two projects would write into the same folder.
    InstallationError
        If a worker is ended from outside, or the cluster cannot be used; completed work is kept.
    """
    there = [request for request in requests if is_there(request.project_file)]
    _require_own_folders(there)
    named = {name for request in there for name in variables_in(request.project_file)}
    done: list[int] = []

    def say(index: int, end: Attempt[ProjectEnd]) -> None:
        done.append(index)
        _log.info("batch: %d of %d: %s", len(done), len(requests), in_one_line(requests[index], end))

    folders = tuple(request.directory for request in there if _is_made(request.directory))
    # A worker without a project takes a second to start all the same.
    most = min(processors() if count is None else count, max(1, len(there)))
    with workers(most, folders, (*sorted(named), REGISTRY_VARIABLE)) as executor:
        ends = run_project.attempt(
            [{"request": request} for request in requests], story, executor=executor, when_done=say
        )
    return tuple(end for end in ends if isinstance(end, ProjectEnd))


def _is_made(folder: Path) -> bool:
    """Whether an output folder is there now; why it could not be made is told by the run that needs it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return True


def _require_own_folders(requests: Sequence[RunRequest]) -> None:
    taken: dict[object, RunRequest] = {}
    for request in requests:
        other = taken.setdefault(request.directory.resolve(), request)
        if other != request:
            raise InputError(
                f"The results of {other.project_file} and {request.project_file} would go into the same "
                f"folder {request.directory}.",
                "Give each project its own folder, or run them one by one with --out.",
            )


def _run_project(story: StoryName | None, *, request: RunRequest) -> ProjectEnd:
    """Run one project, and say how it ended, whatever happens."""
    try:
        outcome = carry_out(story_named(story or request.declared_story()), request)
    except AerocalError as error:
        return ProjectEnd(request, None, str(error))
    except Exception as error:
        # A defect with one project is no reason to leave the others undone.
        what = " ".join(traceback.format_exception_only(error)).strip()
        return ProjectEnd(
            request, None, f"A defect of aerocal ({what}). `aerocal run` of this project shows where."
        )
    return ProjectEnd(request, outcome.summary, outcome.error)


run_project = stage(_run_project)


def in_one_line(request: RunRequest, end: Attempt[ProjectEnd]) -> str:
    """The outcome of a project, for the progress on the screen."""
    name = f"{request.project_file.parent.name}/{request.project_file.name}"
    if not isinstance(end, ProjectEnd) or end.summary is None:
        return f"{name}: failed"
    sigma0 = end.summary.sigma0
    figure = f", σ0 {sigma0:.3f}" if sigma0 is not None else ""
    return f"{name}: {end.summary.status.replace('_', ' ')}{figure}"
