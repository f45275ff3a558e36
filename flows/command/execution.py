"""Carry out a story for a command: in process, or as a Prefect flow when there is a server."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from flows.command.exit_code import OF_STATUS, complain, remark
from flows.command.living_line import living_line
from flows.command.progress import show_progress
from flows.command.result_table import show_result
from flows.runs.project_run import RunOutcome, RunRequest, Story, StoryName, carry_out, story_named
from flows.server.prefect_settings import prepare_prefect, server_to_report_to
from tasks.files.json_text import json_text
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
    name = request.declared_story() if story is None else story
    stages = stages_of(name.replace("_", "-"))
    outcome = outcome_of(request, name, lambda: story_named(name), server, lambda: stages)
    return ended(outcome, show_result, as_json=as_json)


def outcome_of(
    request: RunRequest,
    name: str,
    story: Callable[[], Story],
    server: str | None,
    stages: Callable[[], Sequence[str]] | None = None,
) -> RunOutcome:
    """Run a request here; with a server as a Prefect flow, so that it sees states and logs.

    Parameters
    ----------
    name : of the story; its flow has it, with hyphens.
    story : loads it.
    server : value of the option.
    stages : of the line of progress; None: without it.
    """
    address = server_to_report_to(server, remark)
    console = show_progress(on_screen=address is None)
    if address is not None:
        prepare_prefect(address)
        from flows.serving.registered import run_and_report

        return run_and_report(request, name, story)
    with nullcontext() if stages is None else living_line(console, request.directory, stages()):
        return carry_out(story(), request)


def ended(outcome: RunOutcome, show: Callable[[RunOutcome], None], *, as_json: bool) -> int:
    """Print the JSON summary alone, or the result or the reason why there is none; returns the exit code."""
    if as_json:
        # Plain print: no styling, no wrapping of long lines.
        print(json_text(outcome.summary.to_json(), indent=2))
    elif outcome.error is None:
        show(outcome)
    if outcome.error is not None:
        complain(outcome.error)
        for sentence in outcome.summary.problems[1:]:
            remark(sentence)
    return OF_STATUS[outcome.summary.status]
