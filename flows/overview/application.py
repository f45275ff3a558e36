"""The page as an application: layout, answers, actions in the browser, and protection."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import waitress
from dash import ALL, ClientsideFunction, Dash, Input, Output, State, html

from flows.overview.access import add_results, guard, page_policy
from flows.overview.answers import Answers, places
from flows.overview.layout import page
from flows.overview.metrics import add_metrics
from flows.overview.sources import Sources
from tasks.errors import AerocalError
from tasks.production.board import Changes, Revision

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

    app.server.add_url_rule("/health", view_func=_health)
    add_results(app.server, sources)
    add_metrics(app.server, sources)
    guard(app.server, sources.door, page_policy(app.csp_hashes()))
    return app


@contextmanager
def page_server(sources: Sources, host: str, port: int) -> Iterator[None]:
    """Serve the page in threads of this process while the context lasts."""
    # Its own name and version are nobody's business.
    server = waitress.create_server(application(sources).server, host=host, port=port, threads=6, ident=None)
    # Thousands of runs take some seconds, once; the first visitor need not wait for all of them.
    for work in (server.run, lambda: _read_ahead(sources)):
        threading.Thread(target=work, daemon=True).start()
    try:
        yield
    finally:
        server.close()


def _read_ahead(sources: Sources) -> None:
    # What is wrong with the records is said on the page.
    with suppress(AerocalError):
        sources.board.changes(None)


def _health() -> str:
    return "well"


def _page(sources: Sources) -> Any:
    try:
        changes = sources.board.changes(None)
    except AerocalError as error:
        changes = Changes(Revision("", 0), True, (), ())
        # The next look says it as well, where it stays until it is over.
        return html.Div([html.Div(str(error), className="silent"), page(changes, *places(sources))])
    return page(changes, *places(sources))


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
