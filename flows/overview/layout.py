"""The layout of the page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from dash import dcc, html

from flows.overview.project_grid import project_grid
from flows.overview.sources import Sources
from tasks.production.board import BROKEN, WRONG_INPUT, Changes, ProjectRow, oldest_waiting

#: Milliseconds between two looks, and between two looks at the registry.
_TICK_MS, _SLOW_MS = 10_000, 60_000

_CALIBRATION_LEGEND = (
    "Bars are ± σ; values are relative to the first calibration. Dashed: limit for the change of the "
    "latest from the previous calibration; dotted: from the first of its mounting. At the bottom: days "
    "on which a calibration is in force."
)

Part = Any


def page(changes: Changes, sources: Sources) -> Part:
    """The whole page with its present rows."""
    sections = ("projects", "queue", "trends", "calibrations")
    links = [html.A(name, href=f"#{name}-section") for name in sections]
    camera = dcc.Dropdown(id="camera", clearable=False, placeholder="camera", style={"minWidth": "300px"})
    of_calibrations = [
        html.Div([html.H2("Calibrations"), camera], className="bar"),
        html.Div(id="due"),
        html.Div(id="calibrations", className="plots"),
        html.P(_CALIBRATION_LEGEND, className="note"),
    ]
    return html.Main(
        [
            dcc.Interval(id="tick", interval=_TICK_MS),
            dcc.Interval(id="slow", interval=_SLOW_MS),
            dcc.Store(id="revision", data=revision_data(changes)),
            dcc.Store(id="refreshed"),
            dcc.Store(id="news"),
            html.Div(id="taken", hidden=True),
            html.Header(
                [
                    html.H1("aerocal production"),
                    html.Nav([*links, new_tab("Prefect", sources.dashboard)]),
                    html.Div(id="said", className="said"),
                ]
            ),
            html.Div(id="silent", className="silent", role="alert"),
            html.Div(id="trouble"),
            html.Div(id="cards", className="cards"),
            html.Section(_projects(changes.rows, sources), id="projects-section"),
            _beside(_titled("Queue", "queue", id="queue-section"), _titled("Latest failures", "failures")),
            _beside(
                _titled("σ0 over projects", "sigma0-trend", id="trends-section"),
                _titled("Check-point RMSE over projects", "rmse-trend"),
            ),
            html.Div(id="picked", className="picked"),
            html.Section(of_calibrations, id="calibrations-section"),
        ]
    )


def _titled(heading: str, part: str, **section: Any) -> Part:
    """A section with a heading, and a part that is filled later."""
    return html.Section([html.H2(heading), html.Div(id=part)], **section)


def _beside(*sections: Part) -> Part:
    return html.Div(list(sections), className="columns")


def new_tab(words: str, address: str) -> Part:
    """A link that opens beside the page, which then cannot be reached from there."""
    return html.A(words, href=address, target="_blank", rel="noopener noreferrer")


def revision_data(changes: Changes) -> dict[str, Any]:
    """A revision as the browser keeps it."""
    return {"board": changes.revision.board, "number": changes.revision.number}


def _projects(rows: Sequence[ProjectRow], sources: Sources) -> list[Part]:
    legend = ("✓ done", "↺ reused", "▶ running", "✗ failed", "– not yet")
    return [
        html.Div(
            [
                html.H2("Projects"),
                dcc.Input(
                    id="search", type="search", placeholder="search in all columns", style={"width": "240px"}
                ),
                html.Button("Export CSV", id="export"),
                html.Div([html.Span(text) for text in legend], className="legend"),
            ],
            className="bar",
        ),
        html.Div(no_projects(sources) if not rows else None, id="no-projects"),
        project_grid(rows, sources.dashboard, sources.zone),
        html.Div(id="detail"),
    ]


def no_projects(sources: Sources) -> Part:
    """What the page advises when nothing has been run yet."""
    return html.Div(
        [
            "No project has been run yet. Start one manually: ",
            new_tab("Deployments", f"{sources.dashboard}/v2/deployments"),
            " → aerial-triangulation/manual → Run → Custom run, with a project under ",
            html.Code(", ".join(map(str, sources.roots.folders))),
            "; or copy a delivery into the inbox and create the file ",
            html.Code("DELIVERED"),
            " in it last; or run ",
            html.Code("aerocal run PROJECT.toml"),
            " on this machine.",
        ],
        className="empty",
    )


def cards(rows: Sequence[ProjectRow], due: int | None, now: datetime) -> list[Part]:
    """The number of projects in each state; a click on a card shows only those.

    Parameters
    ----------
    due : calibrations that are due; None: no registry.
    """
    count, waiting, since = Counter[str](row.run.state for row in rows), "waiting", oldest_waiting(rows)
    if since is not None:
        waiting += f", the longest for {in_words((now - since).total_seconds())}"
    shown: list[Part] = [
        html.Button(
            [html.B(str(number := sum(count[state] for state in states))), html.Span(label)],
            id={"card": kind, "states": " ".join(states)},
            className=f"card {kind}" + ("" if number else " none"),
            title="Show only these; click again to show all",
        )
        for kind, label, states in (
            ("passed", "passed", ("Completed",)),
            ("gate", "gate failed", ("GateFailed",)),
            ("input", "wrong input", WRONG_INPUT),
            ("broken", "failed", BROKEN),
            ("running", "running", ("Running",)),
            ("waiting", waiting, ("Scheduled",)),
        )
    ]
    if due is not None:
        words = [html.B(str(due)), html.Span("calibrations due" if due != 1 else "calibration due")]
        kind = "card gate" if due else "card none"
        shown.append(html.A(words, href="#calibrations-section", className=kind))
    return shown


def local_time(time: datetime, form: str, now: datetime) -> str:
    """A time in the time zone of `now`, with the name of that zone."""
    return f"{time.astimezone(now.tzinfo):{form} %Z}"


def in_words(seconds: float) -> str:
    """A span of time in one unit, which no line separates from its number."""
    for size, unit, most in ((1, "s", 99.5), (60, "min", 99 * 60), (3600, "h", 36 * 3600)):
        if seconds < most:
            return f"{max(seconds, 0.0) / size:.0f}\u00a0{unit}"
    return f"{seconds / 86400:.0f}\u00a0d"
