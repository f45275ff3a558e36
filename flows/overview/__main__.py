"""The program of the page: ``python -m flows.overview HOST PORT DASHBOARD``; the rest stands in variables."""

from __future__ import annotations

import logging
import sys

import waitress

from flows.overview.application import application
from flows.overview.sources import configured_sources


def main() -> None:
    """Serve the page until ended."""
    host, port = sys.argv[1], int(sys.argv[2])
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    app = application(configured_sources(sys.argv[3]), host)
    # Its own name and version are nobody's business.
    waitress.serve(app.server, host=host, port=port, threads=6, ident=None)


if __name__ == "__main__":
    main()
