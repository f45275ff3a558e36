"""Carry out a story for a command: in process, or as a Prefect flow when there is a server."""

from __future__ import annotations

from pathlib import Path

from flows.command.exit_code import OF_STATUS, complain
from flows.command.progress import show_progress
from flows.command.result_table import show_result
from flows.prefect_settings import prepare_prefect, require_server, server_address
from flows.project_run import RunOutcome, RunRequest, carry_out


def execute(
    project_file: Path,
    out: Path | None,
    overrides: tuple[str, ...],
    data: Path | None,
    server: str | None,
    *,
    as_json: bool,
) -> int:
    """Run the aerial triangulation of a project and show the result; returns the exit code."""
    request = RunRequest(project_file, out, overrides, data)
    address = server_address(server)
    show_progress(on_screen=address is None)
    outcome = _in_process(request) if address is None else _reported_to(address, request)
    show_result(outcome, as_json=as_json)
    if outcome.error is not None:
        complain(outcome.error)
    return OF_STATUS[outcome.summary.status]


def _in_process(request: RunRequest) -> RunOutcome:
    from flows.aerial_triangulation import aerial_triangulation

    return carry_out(aerial_triangulation, request)


def _reported_to(address: str, request: RunRequest) -> RunOutcome:
    """Run as a Prefect flow: the work is done here, the server sees states and logs."""
    require_server(address)
    prepare_prefect(address)
    from flows.registered import run_and_report

    return run_and_report(request)
