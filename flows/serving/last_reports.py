"""How long a run that has ended reports to its server: as long as it answers, or a while.

Prefect repeats each request and each event for one to two minutes, one after the other; a run of many stages
goes on for hours when its server has another address now. Nothing is lost with what is not reported: how the
run ended is on record, and the server hears of it from there (`flows.server.watch`).
"""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from flows.server.api import Api, configured_api
from flows.server.settings import SETTINGS_VARIABLE

_log = logging.getLogger("aerocal")

#: Seconds between two looks.
_LOOK_S = 2.0


@contextmanager
def reported_for_a_while(seconds: float) -> Iterator[None]:
    """Carry out what is reported afterwards; the process of a run then ends if its server does not answer.

    Any other process (of a command, of a test) goes on.

    Parameters
    ----------
    seconds : how long the server is waited for.
    """
    try:
        yield
    finally:
        # Set by our runner in a process that it has started for this run and nothing else. Of what Prefect's
        # own workers start, nobody may look into the record.
        if {"PREFECT__FLOW_RUN_ID", SETTINGS_VARIABLE} <= os.environ.keys():
            threading.Thread(target=_leave, args=(configured_api(), seconds), daemon=True).start()


def _leave(api: Api, seconds: float) -> None:
    heard = time.monotonic()
    while time.monotonic() < heard + seconds:
        time.sleep(_LOOK_S)
        if api.is_well():
            heard = time.monotonic()
    _log.warning(
        "the server %s has not answered for %.0f s; it hears of the end of this run from the record of runs, "
        "and the process of the run ends", api.url, seconds,
    )  # fmt: skip
    sys.stderr.flush()
    # What a program waits for at its end are the requests that nobody answers.
    os._exit(0)
