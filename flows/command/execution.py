"""Carry out a story for a command: in process, or as a Prefect flow when there is a server."""

from __future__ import annotations

from pathlib import Path

from flows.command.exit_code import OF_STATUS, complain, remark
from flows.command.living_line import living_line
from flows.command.progress import show_progress
from flows.command.result_table import show_result
from flows.runs.project_run import RunOutcome, RunRequest, StoryName, carry_out, story_named
from flows.server.prefect_settings import prepare_prefect, server_to_report_to
from tasks.production.stages import stages_of


def execute(
    project_file: Path,
    out: str | None,
    overrides: tuple[str, ...],
    data: Path | None,
    server: str | None,
    *,
    as_json: bool,
    story: StoryName | None = None,
) -> int:
    """Run a story on a project and show the result; returns the exit code.

    Parameters
    ----------
    story : None: the one that the project file declares.
    """
    request = RunRequest.of(project_file, out, overrides, data)
    story = request.declared_story() if story is None else story
    address = server_to_report_to(server, remark)
    console = show_progress(on_screen=address is None)
    if address is None:
        with living_line(console, request.directory, stages_of(story.replace("_", "-"))):
            outcome = carry_out(story_named(story), request)
    else:
        outcome = _reported_to(address, request, story)
    show_result(outcome, as_json=as_json)
    if outcome.error is not None:
        complain(outcome.error)
    return OF_STATUS[outcome.summary.status]


def _reported_to(address: str, request: RunRequest, story: StoryName) -> RunOutcome:
    """Run as a Prefect flow: the work is done here, the server sees states and logs."""
    prepare_prefect(address)
    from flows.serving import registered

    return registered.run_and_report(request, getattr(registered, story))
