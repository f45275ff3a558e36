"""The page as an application: layout, answers to its requests, actions in the browser, and protection."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import waitress
from dash import ALL, ClientsideFunction, Dash, Input, Output, State, ctx, dcc, html, no_update
from waitress.channel import HTTPChannel
from waitress.trigger import trigger
from waitress.wasyncore import poll

from flows.overview import plots
from flows.overview.access import add_results, guard, page_policy
from flows.overview.layout import cards, local_time, no_projects, page, revision_data
from flows.overview.metrics import add_metrics
from flows.overview.project_grid import GRID, columns_for, row_data
from flows.overview.run_tables import detail_part, failures_part, queue_part
from flows.overview.sources import Sources
from tasks.errors import AerocalError
from tasks.production.board import BROKEN, WRONG_INPUT, Changes, Revision, with_figures
from tasks.production.documents import documents_of

_FAILED = ("GateFailed", *WRONG_INPUT, *BROKEN)
_FAILURES = 15
_OLDER_RUNS = 20
# Seconds that requests under way have when the page ends.
_LAST_ANSWERS = 2
# What anybody sends is stored before the door is asked; the page itself sends a row of the grid at most.
_MOST_BYTES = 1_000_000
_PLOT: Any = {
    "displaylogo": False,
    "responsive": True,
    "plotlyServerURL": "",
    "modeBarButtons": [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
}


@dataclass(frozen=True)
class Answers:
    """The answers to the page."""

    sources: Sources

    def register(self, app: Dash) -> None:
        """Register these answers with the application."""
        ticked, revised = Input("tick", "n_intervals"), Input("revision", "data")
        refreshed = "news.data no-projects.children revision.data cards.children said.children "
        refreshed += "trouble.children refreshed.data queue.children"
        trends = "sigma0-trend.children rmse-trend.children failures.children"
        of_cameras = "camera.options camera.value due.children"
        app.callback(_outputs(refreshed), ticked, State("revision", "data"))(self.refresh)
        app.callback(_outputs(trends), revised)(self.follow)
        app.callback(Output("detail", "children"), Input(GRID, "selectedRows"))(self.detail_of_row)
        app.callback(
            Output("picked", "children"), Input({"trend": ALL}, "clickData"), prevent_initial_call=True
        )(self.detail_of_point)
        chosen = State("camera", "value")
        app.callback(_outputs(of_cameras), Input("slow", "n_intervals"), chosen)(self.cameras)
        app.callback(Output("calibrations", "children"), Input("camera", "value"))(self.series)

    def refresh(self, ticks: int | None, revision: dict[str, Any]) -> tuple[Any, ...]:
        """What has changed since a revision, the counts, the state of the server, and its queue."""
        sources, now = self.sources, self.sources.now()
        try:
            changes = sources.board.changes(Revision(str(revision["board"]), int(revision["number"])))
            view, watch = sources.server(), sources.calibrations().watch
        except AerocalError as error:
            trouble = html.Div(str(error), className="silent")
            return (*(no_update,) * 5, trouble, now.isoformat(), no_update)
        rows = sources.board.rows()
        due = None if watch is None else len(watch.due)
        return (
            _news(changes, sources.zone),
            no_projects(sources) if not rows else None,
            no_update if changes.is_empty and ticks else revision_data(changes),
            cards(rows, due, now),
            _state_of_server(view.reachable, now),
            None,
            now.isoformat(),
            queue_part(view, sources.inbox(), now, sources.dashboard),
        )

    def follow(self, _revision: dict[str, Any]) -> tuple[Any, Any, Any]:
        """Trends of σ0 and of RMS at check points, and the last failures."""
        rows = self.sources.board.rows()
        shown = with_figures(rows)
        try:
            failed = self.sources.records.runs(states=_FAILED, most=_FAILURES)
        except AerocalError as error:
            return no_update, no_update, html.Div(str(error), className="empty")
        passed = {
            (row.run.project_file, row.run.story): row.changed for row in rows if row.run.state == "Completed"
        }
        since = {
            run.id
            for run in failed
            if (last := passed.get((run.project_file, run.story))) is not None
            and last > (run.ended or run.scheduled)
        }
        sigma0, rmse = (draw(shown, self.sources.zone) for draw in (plots.sigma0_figure, plots.rmse_figure))
        return (
            _plot(sigma0, "No project has been adjusted yet.", {"trend": "sigma0"}),
            _plot(rmse, "No project with check points has been adjusted yet.", {"trend": "rmse"}),
            failures_part(failed, since, self.sources.now(), self.sources.dashboard),
        )

    def detail_of_row(self, selected: list[dict[str, Any]] | None) -> Any:
        """Details of the latest run of the project whose row is selected."""
        return self._detail(str(selected[0].get("run"))) if selected else None

    def detail_of_point(self, _clicks: list[Any]) -> Any:
        """Details of the run whose point in a trend was clicked."""
        point: dict[str, Any] = next(iter((ctx.triggered[0]["value"] or {}).get("points", ())), {})
        told = point.get("customdata")
        return self._detail(str(told[2])) if isinstance(told, list) and len(told) > 2 else no_update

    def cameras(self, _ticks: int | None, chosen: str | None) -> tuple[Any, Any, Any]:
        """The cameras to choose from, the chosen one, and which calibrations are due."""
        found = self.sources.calibrations()
        if found.watch is None:
            return [], None, _no_calibrations(found.trouble)
        options = plots.cameras_of(found.watch)
        keys = [option["value"] for option in options]
        value = chosen if chosen in keys else next(iter(keys), None)
        kind = "due" if found.watch.due else "fine"
        said = [html.Div(sentence, className=kind) for sentence in found.watch.sentences]
        return options, value, said

    def series(self, chosen: str | None) -> Any:
        """The time series of the calibrations of a camera."""
        watch = self.sources.calibrations().watch
        if watch is None or chosen is None:
            return None
        shown = [series for series in watch.series if series.camera_key == chosen]
        return [
            _plot(plots.series_figure(series, watch.today), "", {"series": str(number)})
            for number, series in enumerate(shown)
        ]

    def _detail(self, run_id: str) -> Any:
        sources = self.sources
        try:
            run = sources.records.run(run_id)
            if run is None:
                return None
            file, there = run.project_file, sources.records.holds_results(run)
            older = sources.records.runs(project_file=file, most=_OLDER_RUNS) if file else ()
            documents = documents_of(run, sources.roots.folders) if there else ()
        except AerocalError as error:
            return html.Div(str(error), className="detail")
        return detail_part(run, older, documents, sources.now(), sources.dashboard)


def _outputs(names: str) -> list[Output]:
    """Properties of parts of the page, each as PART.PROPERTY."""
    return [Output(part, name) for part, name in (one.split(".") for one in names.split())]


def _state_of_server(reachable: bool, now: datetime) -> list[Any]:
    answers = (
        html.Span("server answers") if reachable else html.Span("server DOES NOT ANSWER", className="down")
    )
    return [answers, html.Span(f"refreshed {local_time(now, '%H:%M:%S', now)}")]


def _news(changes: Changes, zone: ZoneInfo) -> Any:
    """What the grid does not show yet, judged by what the browser says it has."""
    if changes.is_empty:
        return no_update
    rows = [row_data(row, zone) for row in changes.rows]
    columns = columns_for(changes.rows)
    return {"whole": changes.whole, "rows": rows, "removed": list(changes.removed), "columns": columns}


def _plot(figure: dict[str, Any] | None, without: str, name: str | dict[str, str]) -> Any:
    if figure is None:
        return html.Div(without, className="empty")
    return dcc.Graph(figure=figure, config=_PLOT, id=name, style={"width": "100%"})


def _no_calibrations(trouble: str | None) -> Any:
    if trouble is not None:
        return html.Div(trouble, className="due")
    return html.Div(
        [
            "This server has no registry of calibrations. Start it with ",
            html.Code("aerocal serve --registry ADDRESS"),
            "; ",
            html.Code("aerocal registry add"),
            " creates one from the results of a calibration flight.",
        ],
        className="empty",
    )


_INDEX = """<!DOCTYPE html>
<html lang="en">
    <head>{%metas%}<title>{%title%}</title>{%favicon%}{%css%}</head>
    <body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body>
</html>"""


def application(sources: Sources) -> Dash:
    """The page."""
    app = Dash(
        "aerocal-overview",
        assets_folder=str(Path(__file__).with_name("assets")),
        serve_locally=True,
        title="aerocal production",
        update_title="",
        index_string=_INDEX,
        compress=False,
        enable_mcp=False,
        use_pages=False,
        include_pages_meta=False,
        meta_tags=[{"name": "viewport", "content": "width=device-width, initial-scale=1"}],
    )
    app.layout = lambda: _page(sources)
    Answers(sources).register(app)
    _act_in_the_browser(app)

    app.server.add_url_rule("/health", "health", lambda: "well")
    add_results(app.server, sources)
    add_metrics(app.server, sources)
    guard(app.server, sources.door, page_policy(app.csp_hashes()))
    return app


@contextmanager
def page_server(sources: Sources, host: str, port: int) -> Iterator[None]:
    """Serve the page in threads of this process while the context lasts."""
    sockets: dict[int, Any] = {}
    app = application(sources).server
    # Its own name and version are nobody's business.
    own: Any = {"map": sockets, "ident": None, "max_request_body_size": _MOST_BYTES}
    server = waitress.create_server(app, host=host, port=port, threads=6, **own)
    waker = next(one for one in sockets.values() if isinstance(one, trigger))
    ends = threading.Event()
    polling = threading.Thread(target=_poll, args=[sockets, ends], daemon=True)
    polling.start()
    # Thousands of runs take some seconds, once; the first visitor need not wait for all of them.
    threading.Thread(target=_read_ahead, args=[sources], daemon=True).start()
    try:
        yield
    finally:
        server.task_dispatcher.shutdown(timeout=_LAST_ANSWERS)
        ends.set()
        waker.pull_trigger()
        # Polling fails on a socket that is closed meanwhile.
        polling.join()
        for one in list(sockets.values()):
            # Large answers that wait for their visitor are in files.
            (one.handle_close if isinstance(one, HTTPChannel) else one.close)()


def _poll(sockets: dict[int, Any], ends: threading.Event) -> None:
    while not ends.is_set():
        poll(1.0, sockets)


def _read_ahead(sources: Sources) -> None:
    # What is wrong with the records is said on the page.
    with suppress(AerocalError):
        sources.board.changes(None)


def _page(sources: Sources) -> Any:
    try:
        changes = sources.board.changes(None)
    except AerocalError as error:
        changes = Changes(Revision("", 0), True, (), ())
        # The next look says it as well, where it stays until it is over.
        return html.Div([html.Div(str(error), className="silent"), page(changes, sources)])
    return page(changes, sources)


def _act_in_the_browser(app: Dash) -> None:
    """What the page does without its server."""

    def by(function: str, *places: Any) -> None:
        app.clientside_callback(  # type: ignore[no-untyped-call]
            ClientsideFunction("overview", function), *places
        )

    by("news", Output("taken", "children"), Input("news", "data"))
    by("search", Output("search", "className"), Input("search", "value"))
    by("exported", Output("export", "className"), Input("export", "n_clicks"))
    by("only", Output("cards", "className"), Input({"card": ALL, "states": ALL}, "n_clicks"))
    by("tick", Output("silent", "children"), Input("tick", "n_intervals"), State("refreshed", "data"))
