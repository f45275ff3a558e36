"""Carry out ``aerocal plan``: from a specification or a project to its network and what it determines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from flows.command.exit_code import DONE, GATE_FAILED
from flows.command.plan_table import plan_table
from flows.command.progress import show_progress
from tasks.files.json_text import json_text
from tasks.planning.free_names import free_from_text, selection_from_text
from tasks.planning.plan import CalibrationPlan
from tasks.planning.plan_json import plan_json
from tasks.settings.load import is_project_file


@dataclass(frozen=True)
class PlanOptions:
    """The options of the command line.

    Attributes
    ----------
    source : preset, specification or project file.
    free : names separated by commas; None: the default.
    additional : selection of additional parameters; None: that of the project.
    strip_bias : metres; None: the default, or the project's.
    overrides : texts ``a.b.c=VALUE``.
    data : a second folder for relative input paths of a project.
    proposals : whether to look for additions.
    """

    source: str
    free: str | None
    additional: str | None
    strip_bias: float | None
    overrides: tuple[str, ...]
    data: Path | None
    proposals: bool


def _of_source(source: str) -> Callable[..., CalibrationPlan]:
    """The function that plans a source; only the modules it needs are loaded."""
    if is_project_file(source):
        from flows.stories.project_plan import plan_of_project

        return plan_of_project
    from flows.stories.project_plan import plan_of_specification

    return plan_of_specification


def execute_plan(options: PlanOptions, *, as_json: bool) -> int:
    """Compute a plan and print it; wrong input raises InputError."""
    show_progress()
    free = None if options.free is None else free_from_text(options.free)
    plan = _of_source(options.source)(
        options.source,
        options.overrides,
        options.data,
        free=free,
        additional=None if options.additional is None else selection_from_text(options.additional),
        strip_bias_m=options.strip_bias,
        propose=options.proposals,
    )
    if as_json:
        print(json_text(plan_json(plan), indent=2))
    else:
        Console().print(plan_table(plan))
    return DONE if plan.expectation.accepted else GATE_FAILED
