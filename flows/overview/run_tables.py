"""Queue, failures, and details of one project: tables of plain text and links."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any
from urllib.parse import quote

from dash import html

from flows.overview.layout import in_words, local_time, new_tab
from flows.overview.project_grid import STORY_LABELS
from flows.overview.sources import QueuedRun, ServerView
from flows.server.inbox import Scheduled
from tasks.production.board import in_project, problems_of
from tasks.production.run_record import RunRecord
from tasks.production.short_text import REMEDIES
from tasks.quantities import unit_words
from tasks.results.quality_gates import GateResult

Part = Any
_SHOWN = 25
#: Headings of a run that has ended, after its name.
_ENDED = ("Story", "State", "Age", "Message")


def queue_part(view: ServerView, inbox: Scheduled | None, now: datetime, dashboard: str) -> Part:
    """Active and waiting runs, and deliveries held back in the inbox."""
    parts: list[Part] = []
    if view.queue:
        head = ("Run", "State", "Waits", "Runs for")
        parts.append(_table(head, [_queued(run, now, dashboard) for run in view.queue[:_SHOWN]]))
    else:
        parts.append(html.Div("No run is waiting or running.", className="empty"))
    more = max(len(view.queue) - _SHOWN, 0) + view.more
    if more:
        parts.append(html.P(f"And {more:,} more."))
    if view.next is not None:
        when = f" {_ahead(view.next.due, now)}."
        parts.append(html.P(["Next by schedule: ", run_link(dashboard, view.next.run, view.next.name), when]))
    if not view.reachable:
        parts.append(html.P("The server does not answer; this is based on the records."))
    if inbox is not None:
        parts += _inbox_parts(inbox, view.search, now)
    return parts


def _ahead(due: datetime, now: datetime) -> str:
    return f"at {local_time(due, '%a %d %b %H:%M', now)} (in {in_words((due - now).total_seconds())})"


def _inbox_parts(inbox: Scheduled, search: datetime | None, now: datetime) -> list[Part]:
    parts: list[Part] = []
    if inbox.on_schedule:
        told = f"Complete deliveries that wait for the schedule: {_names(inbox.on_schedule)}. "
        parts.append(html.P(told + _turn(search, now)))
    if inbox.refused:
        parts += [
            html.H3(f"Deliveries that cannot be started: {len(inbox.refused)}"),
            html.Ul([html.Li(sentence) for sentence in inbox.refused[:_SHOWN]]),
        ]
    if inbox.waiting:
        told = "Deliveries that are not complete yet (no file DELIVERED, or still changing): "
        parts.append(html.P(f"{told}{_names(inbox.waiting)}."))
    return parts


def _names(folders: Sequence[str]) -> str:
    more = len(folders) - _SHOWN
    return ", ".join(folders[:_SHOWN]) + (f" and {more:,} more" if more > 0 else "")


def _turn(search: datetime | None, now: datetime) -> str:
    """When the deliveries start that the next search of the inbox will find."""
    if search is None:
        return "No time is known: see the schedule of inbox/nightly in Prefect."
    return f"They start {_ahead(search, now)}." if search > now else "It is their turn now."


def _queued(run: QueuedRun, now: datetime, dashboard: str) -> Sequence[Part]:
    since = run.waiting_since(now)
    return (
        run_link(dashboard, run.run, run.name),
        run.state,
        "" if since is None else in_words((now - since).total_seconds()),
        "" if run.begun is None else in_words((now - run.begun).total_seconds()),
    )


def failures_part(
    runs: Sequence[RunRecord], passed_since: Collection[str], now: datetime, dashboard: str
) -> Part:
    """The runs that did not pass, the latest first.

    Parameters
    ----------
    passed_since : those whose story has since passed on the same project.
    """
    if not runs:
        return html.Div("No run has failed.", className="empty")
    rows = [
        _ended(run, run.project, now, dashboard, " A later run has passed." if run.id in passed_since else "")
        for run in runs
    ]
    return _table(("Project", *_ENDED), rows)


def detail_part(
    run: RunRecord, runs: Sequence[RunRecord], documents: Sequence[str], now: datetime, dashboard: str
) -> Part:
    """Details of one project: problems, gates, documents and older runs.

    Parameters
    ----------
    run : the selected one.
    runs : of the project file, the latest first.
    documents : names of the documents it has.
    """
    parts: list[Part] = [
        html.H2(f"{run.project} · {STORY_LABELS.get(run.story, run.story)} · {run.state}"),
        html.P([html.Code(run.project_file or "no project file"), " → ", html.Code(run.directory or "–")]),
    ]
    links = [new_tab(name, f"/results/{quote(run.id, safe='')}/{quote(name, safe='')}") for name in documents]
    links.append(run_link(dashboard, run.id, "run in Prefect"))
    parts.append(html.P([part for link in links for part in (link, "   ")]))
    if problems := problems_of(run):
        parts += [html.H3("Problems and remarks"), html.Ul([html.Li(text) for text in problems])]
    elif run.message:
        parts.append(html.P(run.message))
    if run.state in REMEDIES:
        parts += [html.H3("What to do"), html.P(REMEDIES[run.state])]
    if run.figures.gates:
        rows = [_gate(gate) for gate in run.figures.gates]
        parts += [html.H3("Gates"), _table(("Figure", "Value", "Limit", ""), rows)]
    older = [
        _ended(one, local_time(one.scheduled, "%Y-%m-%d %H:%M", now), now, dashboard)
        for one in runs
        if one.id != run.id
    ]
    if older:
        parts += [html.H3("Other runs of this project"), _table(("Run", *_ENDED), older)]
    return html.Div(parts, className="detail")


def _ended(run: RunRecord, name: str, now: datetime, dashboard: str, remark: str = "") -> Sequence[Part]:
    """A run under a name, and how it ended, as cells."""
    return (
        run_link(dashboard, run.id, name),
        STORY_LABELS.get(run.story, run.story),
        run.state,
        in_words((now - (run.ended or run.scheduled)).total_seconds()),
        _Message(in_project(run, run.message) + remark),
    )


def run_link(dashboard: str, run: str, text: str) -> Part:
    """A link to the run on the server's own pages."""
    return new_tab(text, f"{dashboard}/v2/runs/flow-run/{quote(run, safe='')}")


class _Message(str):
    """A message, which needs a wide column."""


def _table(head: Sequence[str], rows: Sequence[Sequence[Part]]) -> Part:
    body = [
        html.Tr([html.Td(cell, className="message" if isinstance(cell, _Message) else None) for cell in row])
        for row in rows
    ]
    return html.Div(
        html.Table([html.Thead(html.Tr([html.Th(text) for text in head])), html.Tbody(body)]),
        className="scroll",
    )


def _gate(gate: GateResult) -> Sequence[Part]:
    (value, limit), unit = gate.words, unit_words(gate.unit)
    return (
        gate.name,
        "not available" if gate.value is None else f"{value} {unit}",
        f"{'≤' if gate.bound == 'max' else '≥'} {limit} {unit}",
        "passed" if gate.passed else "▲ not passed",
    )
