"""The program of the page: ``python -m flows.overview HOST PORT DASHBOARD``; the rest stands in variables."""

from __future__ import annotations

import contextlib
import logging
import sys
import threading

import waitress

from flows.overview.application import application
from flows.overview.sources import Sources, configured_sources
from tasks.errors import AerocalError


def main() -> None:
    """Serve the page until ended."""
    host, port = sys.argv[1], int(sys.argv[2])
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    sources = configured_sources(sys.argv[3])
    # Thousands of runs take some seconds, once; the first visitor need not wait for all of them.
    threading.Thread(target=_read_ahead, args=(sources,), daemon=True).start()
    app = application(sources)
    # Its own name and version are nobody's business.
    waitress.serve(app.server, host=host, port=port, threads=6, ident=None)


def _read_ahead(sources: Sources) -> None:
    # What is wrong with the records is said on the page.
    with contextlib.suppress(AerocalError):
        sources.board.changes(None)


if __name__ == "__main__":
    main()
