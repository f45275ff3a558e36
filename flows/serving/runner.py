"""The program of the runner: ``python -m flows.serving.runner OPTIONS``."""

from __future__ import annotations

import logging
import sys

from flows.serving.options import options_from


def main() -> None:
    """Carry out runs of the deployments until asked to end; then finish those that have begun."""
    logging.getLogger("aerocal").setLevel(logging.INFO)
    # Every two seconds as long as runs wait for their turn.
    logging.getLogger("prefect.runner").addFilter(lambda said: "skipped (at capacity)" not in said.msg)
    # Loads Prefect, which nothing but this process and its runs has to.
    from flows import deployments

    deployments.serve(options_from(sys.argv[1]))


if __name__ == "__main__":
    main()
