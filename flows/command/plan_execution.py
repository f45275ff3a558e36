"""Carry out ``aerocal plan``: from a specification or a project to its network and what it determines.

On the screen: verdict, reasons, every quantity with its limit, correlations, and what to add.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE, GATE_FAILED
from flows.command.progress import show_progress
from flows.command.screen_table import facts_table, screen, screen_table
from tasks.calibration.pattern_words import direction_words, height_words
from tasks.errors import InputError
from tasks.files.json_text import json_text
from tasks.magnitude import trouble_in_number
from tasks.planning.plan import CalibrationPlan, Expectation, Proposal
from tasks.planning.plan_json import addition_words, plan_json
from tasks.planning.request import free_from_text, selection_from_text
from tasks.quantities import written_sigma
from tasks.settings.load import is_project_file

_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "held": ""}
_SHOWN_PROPOSALS = 12
_SHOWN_CORRELATION = 0.5


def plan_table(plan: CalibrationPlan) -> RenderableType:
    """Everything a person needs to decide about a flight."""
    here = plan.expectation
    verdict = f"\n{plan.name}: {here.flight.verdict} as a calibration flight"
    parts: list[RenderableType] = [Text(verdict, style="bold green" if here.accepted else "bold red")]
    parts += [_network(here, plan.request.strip_bias_m), Text(), _quantities(here)]
    correlations = _correlations(here)
    parts += [Text(), correlations] if correlations.row_count else []
    rules = [reason for reason in here.flight.reasons if not _is_of_quantity(reason, here)]
    needs = [f"{item}: {item.because}" for item in here.quantities if item.verdict != "determined"]
    parts += _sentences("Why", [*rules, *needs], "red")
    parts += _sentences("Remarks", [*here.flight.remarks, *_about_elimination(plan)], "yellow")
    if plan.proposals:
        parts += [Text(), _proposals(plan), Text(), _cheapest(plan)]
    return Group(*parts)


def _is_of_quantity(reason: str, here: Expectation) -> bool:
    """Whether a reason concerns a single quantity; those are in the table."""
    return any(reason.startswith(f"{item} is ") for item in here.quantities)


def _about_elimination(plan: CalibrationPlan) -> list[str]:
    settings = plan.request.self_calibration
    if not plan.request.has_additional or settings.elimination == "none":
        return []
    return [
        f"All of {settings.parameters} are assumed to be estimated. Parameters that are not significant "
        "will be eliminated; the σ of the others then become smaller."
    ]


def _network(here: Expectation, strip_bias: float) -> Table:
    bias = f"{written_sigma(strip_bias, 'm')}" if strip_bias > 0.0 else "none (independent errors)"
    return facts_table(
        (
            ("images, strips", f"{here.images:,}, {here.strips}"),
            *([("exposures of the rig", f"{here.exposures:,}")] if here.images > here.exposures else []),
            ("object points, image points", f"{here.points:,}, {here.rays:,}"),
            ("control points", f"{here.control}"),
            ("directions", direction_words(here.pattern)),
            ("heights", height_words(here.pattern)),
            ("GNSS error of a strip", bias),
        )
    )


def _quantities(here: Expectation) -> Table:
    table = screen_table(
        "parameter", "entity", "σ", "limit", "σ/prior", "verdict",
        right=("σ", "limit", "σ/prior"), whole=("parameter", "verdict"), title="Expected standard deviations",
    )  # fmt: skip
    units = here.parameters.set_index(["parameter", "entity"])["unit"]
    for item in here.quantities:
        unit = str(units[item.parameter, item.entity])
        table.add_row(
            item.parameter,
            item.entity,
            "–" if item.sigma is None else written_sigma(item.sigma, unit),
            "–" if item.limit is None else written_sigma(item.limit, unit),
            "–" if item.sigma_over_prior is None else f"{item.sigma_over_prior:.3f}",
            Text(item.verdict.replace("_", " "), style=_STYLES[item.verdict]),
        )
    return table


def _correlations(here: Expectation) -> Table:
    """The most strongly correlated pairs, each once."""
    table = screen_table("of", "with", "", right=("",), title="Strongest correlations")
    pairs = {
        frozenset({str(item), str(item.strongest)}): (str(item), item.strongest)
        for item in here.quantities
        if item.strongest is not None
    }
    for name, other in sorted(pairs.values(), key=lambda pair: -abs(pair[1].correlation)):
        if abs(other.correlation) >= _SHOWN_CORRELATION:
            table.add_row(name, str(other), f"{other.correlation:+z.3f}")
    return table


def _sentences(title: str, sentences: Sequence[str], style: str) -> list[RenderableType]:
    if not sentences:
        return []
    lines = [Text(f"• {sentence}", style=style) for sentence in sentences]
    return [Text(f"\n{title}", style="bold"), Padding(Group(*lines), (0, 0, 0, 0))]


def _proposals(plan: CalibrationPlan) -> Table:
    headings = ("in addition", "exposures", "largest σ/limit", "verdict")
    table = screen_table(*headings, right=("exposures",), title="Additions, by number of exposures")
    for proposal in _shown(plan):
        expectation = proposal.expectation
        table.add_row(
            addition_words(proposal.addition),
            f"+{proposal.addition.exposures}",
            f"{expectation.worst_part:.2f} {expectation.worst.parameter}",
            Text(expectation.flight.verdict, style="green" if expectation.accepted else "red"),
        )
    left_out = len(plan.proposals) - table.row_count
    if left_out:
        table.caption = f"{left_out} more that are not sufficient are in --json"
    return table


def _shown(plan: CalibrationPlan) -> list[Proposal]:
    """The last additions: the one that suffices, and those just before it."""
    return list(plan.proposals[-_SHOWN_PROPOSALS:])


def _cheapest(plan: CalibrationPlan) -> Text:
    found = plan.cheapest
    if found is None:
        nearest = min(plan.proposals, key=lambda item: item.expectation.worst_part)
        return Text(
            f"None of these additions meets the limits; the best is {addition_words(nearest.addition)}, "
            f"with {nearest.expectation.worst} at {nearest.expectation.worst_part:.2f} times its limit.",
            style="bold red",
        )
    count = found.addition.exposures
    exposures = f"{count} exposures" if count else "no more exposures"
    return Text(
        f"Cheapest addition that meets the limits: {addition_words(found.addition)} ({exposures}).",
        style="bold green",
    )


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
    trouble = trouble_in_number(options.strip_bias or 0.0)
    if trouble is not None:
        raise InputError(trouble, "Give the σ in metres.", entity="--strip-bias")
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
        screen().print(plan_table(plan))
    return DONE if plan.expectation.accepted else GATE_FAILED
